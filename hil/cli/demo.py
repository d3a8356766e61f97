"""`hil demo`: the main job on the embedded simulated bench."""

from __future__ import annotations

from pathlib import Path

import typer

from hil.cli.language import Language
from hil.cli.reading import Json


def command(
    out: Path = typer.Option(Path("demo"), "--out", help="Folder to make, with everything that the job leaves."),
    conceal: str = typer.Option("friction", "--conceal", help="The effect that the second recordings conceal."),
    language: Language = "",  # noqa: ARG001 — its callback takes it
    as_json: Json = False,
) -> None:
    """Test and identify a valve, meet recordings that conceal an effect, diagnose them, write the reports."""
    from hil.cli.places import check_folder
    from hil.cli.progress import shown
    from hil.session.demo import demonstrate

    check_folder(out)
    typer.echo("Brevini HPV41 on the simulated bench, in virtual time", err=as_json)
    with shown() as progress:
        done = demonstrate(out, conceal, progress)
    if as_json:
        from hil.record.plain import to_json

        tests = {name: outcome.folder for name, outcome in done.tests.items()}
        told = {"tests": tests, "concealed": conceal, "model": out / "nominal.json", "fits": done.identified.fits}
        diagnosis = {**done.diagnosed.diagnosis.as_dict()}
        typer.echo(to_json({"schema": "hil.demo/1", **told, "diagnosis": diagnosis, "report": done.report}))
        return
    typer.echo(done.identified.summary())
    typer.echo(f"concealed in the second recordings: {conceal}")
    typer.echo(done.diagnosed.diagnosis.as_text())
    for name, outcome in done.tests.items():
        typer.echo(f"{name}: {outcome.report}")
    typer.echo(f"report: {done.report}")
