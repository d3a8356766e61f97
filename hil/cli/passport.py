"""`hil passport`: one signed file that a unit takes along."""

from __future__ import annotations

from pathlib import Path

import typer

from hil.cli.language import Language
from hil.cli.reading import Json


def command(
    runs: list[Path] = typer.Argument(..., metavar="RUN...", help="Run folders of one unit."),
    out: Path = typer.Option(..., "--out", metavar="FILE.pdf", help="The passport."),
    no_names: bool = typer.Option(False, "--no-names", help="Leave out who ran the tests, in every file inside."),
    no_model: bool = typer.Option(False, "--no-model", help="Do not identify the unit; page one says so."),
    model: Path | None = typer.Option(
        None, "--model", metavar="MODEL.json", help="Model of the type; states what these data excluded."
    ),
    key: Path | None = typer.Option(
        None, "--key", metavar="FILE", help="The lab's key with its certificate, PEM or PKCS #12; else this machine's."
    ),
    language: Language = "",  # noqa: ARG001 — its callback takes it
    as_json: Json = False,
) -> None:
    """Put runs of one unit into one signed PDF: the certificate, the recordings, and the unit's model."""
    from hil.cli.places import check_distinct, check_file
    from hil.cli.progress import shown
    from hil.passport.issue import Wanted, issue
    from hil.passport.key import signing_key

    check_distinct(runs)
    check_file(out)
    kind = None
    if model is not None:
        from hil.physics.model import load_model

        kind = load_model(model)
    wanted = Wanted(not no_names, not no_model, kind)
    with shown() as progress:
        found = issue(runs, out, signing_key(key), wanted, progress)
    if as_json:
        from hil.record.plain import to_json

        unit = {"valve": found.unit.valve, "serial": found.unit.serial, "verdict": found.unit.verdict}
        signer = {"signer": found.signer.name, "fingerprint": found.signer.fingerprint}
        told = {"file": found.path, **unit, **signer, "model": found.understood.says}
        typer.echo(to_json({"schema": "hil.issued/1", **told}))
        return
    typer.echo(f"passport: {found.path}")
    unfinished = "" if found.unit.finished else "; a test did not end as planned"
    typer.echo(f"unit: {found.unit.valve}, {found.unit.serial}: {found.unit.verdict or 'not judged'}{unfinished}")
    typer.echo(f"signed by: {found.signer.name}, {found.signer.fingerprint}")
    typer.echo(f"model: {found.understood.says}")
