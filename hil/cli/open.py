"""`hil open`: what a passport holds, as files."""

from __future__ import annotations

from pathlib import Path

import typer

from hil.cli.printed import Json, printed


def command(
    file: Path = typer.Argument(..., metavar="FILE", help="Passport."),
    out: Path = typer.Option(..., "--out", metavar="DIR", help="Folder to make."),
    as_json: Json = False,
) -> None:
    """Lay out the run folders, the model and the pages of a passport, ready for every command.

    A passport that was changed is not opened; whether its signer is known, `hil verify` says.
    """
    from hil.cli.places import check_folder
    from hil.passport.contents import lay_out
    from hil.passport.verify import opened

    check_folder(out)
    content, found = opened(file)
    runs = list(lay_out(content, out))
    files = sorted(path for path in out.iterdir() if path.is_file())
    told = {"file": file, "sentence": found.sentence, "signer": found.signer, "runs": runs, "files": files}
    laid_out = [*(f"run: {run}" for run in runs), *(f"file: {path}" for path in files)]
    words = "\n".join([*laid_out, f"{file}: {found.sentence}: {found.signer}"])
    printed({"schema": "hil.opened/1", **told}, words, as_json)
