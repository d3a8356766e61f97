"""`hil demo`: the main job on the embedded simulated bench."""

from __future__ import annotations

from pathlib import Path

import typer

from hil.cli.options import Json, Language, option
from hil.cli.printed import printed


def command(
    out: Path = option(Path("demo"), "--out", help="Folder to make, with everything that the job leaves."),
    language: Language = "",  # noqa: ARG001 — its callback takes it
    as_json: Json = False,
) -> None:
    """Test and identify a valve, meet recordings that conceal an effect, diagnose them, write the reports."""
    from hil import api
    from hil.cli.places import check_folder
    from hil.cli.progress import shown
    from hil.report.terminal import where
    from hil.session.demo import CONCEALED

    check_folder(out)
    typer.echo("the Brevini HPV41 of the paper, as identified, on the simulated bench, in virtual time", err=as_json)
    with shown() as progress:
        done = api.demo(out, progress=progress)
    identified, diagnosis = done.identified, done.diagnosed.diagnosis
    pages = [line for name, outcome in done.tests.items() for line in where(outcome.report, name)]
    concealed = f"concealed in the second recordings: {CONCEALED.name}"
    words = "\n".join([identified.summary(), concealed, diagnosis.as_text(), *pages, *where(done.report)])
    tests = {name: outcome.folder for name, outcome in done.tests.items()}
    document = {"tests": tests, "concealed": CONCEALED.name, "model": out / "nominal.json", "fits": identified.fits}
    document |= {"diagnosis": diagnosis.as_dict(), "report": done.report}
    printed({"schema": "hil.demo/1", **document}, words, as_json)
