"""`hil open`: what a passport holds, as files."""

from __future__ import annotations

from pathlib import Path

import typer


def command(
    file: Path = typer.Argument(..., metavar="FILE", help="Passport."),
    out: Path = typer.Option(..., "--out", metavar="DIR", help="Folder to make."),
) -> None:
    """Lay out the run folders, the model and the pages of a passport, ready for every command.

    A passport that was changed is not opened; whether its signer is known, `hil verify` says.
    """
    from hil.cli.places import check_folder
    from hil.passport.contents import lay_out
    from hil.passport.verify import opened

    check_folder(out)
    content, found = opened(file)
    for run in lay_out(content, out):
        typer.echo(f"run: {run}")
    for path in sorted(path for path in out.iterdir() if path.is_file()):
        typer.echo(f"file: {path}")
    typer.echo(f"{file}: {found.sentence}: {found.signer}")
