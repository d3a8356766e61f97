"""`hil open`: what a passport holds, as files."""

from __future__ import annotations

import sys
from pathlib import Path

import typer

from hil.cli.options import Json, argument, option
from hil.cli.printed import printed
from hil.errors import FileError


def command(
    file: Path = argument(..., "FILE", "Passport."),
    out: Path = option(..., "--out", "DIR", "Folder to make."),
    most: float | None = option(
        None, "--most", "MB", "What its files may unpack to; of a signer unknown here 268.", min=0.0
    ),
    as_json: Json = False,
) -> None:
    """Lay out the run folders, the model and the pages of a passport, ready for every command.

    A passport that was changed is not opened; whether its signer is known, `hil verify` says.
    """
    from hil.cli.places import check_folder
    from hil.passport.contents import LargeError, lay_out
    from hil.passport.verify import opened

    check_folder(out)
    content, found = opened(file)
    try:
        runs = list(lay_out(content, out, found.most_bytes if most is None else 1e6 * most))
    except LargeError as error:
        signer = "" if found.is_sound else ", and its signer is not known here"
        _ask(f"{file}: {error}{signer}", "--most MB" if most is None else "")
        runs = list(lay_out(content, out))
    files = sorted(path for path in out.iterdir() if path.is_file())
    document = {"file": file, "sentence": found.sentence, "signer": found.signer, "runs": runs, "files": files}
    laid_out = [*(f"run: {run}" for run in runs), *(f"file: {path}" for path in files)]
    words = "\n".join([*laid_out, f"{file}: {found.sentence}: {found.signer}"])
    printed({"schema": "hil.opened/1", **document}, words, as_json)


def _ask(sentence: str, option: str) -> None:
    """Ask at a terminal whether to go on.

    Raises:
        FileError: nobody can be asked, or the answer is no; nothing was written.
    """
    if option and sys.stdin.isatty() and sys.stderr.isatty() and typer.confirm(f"{sentence}; lay out all", err=True):
        return
    hint = f"; {option} allows more" if option else ""
    raise FileError(f"{sentence}; nothing was written{hint}")
