"""What a command reads and where it may write, looked at before the work is done."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from hil.errors import FileError
from hil.untrusted import resolved


def check_distinct(recordings: Sequence[Path]) -> None:
    """Raise `FileError` when a recording is named twice: it would count as two."""
    seen: set[Path] = set()
    for path in recordings:
        if resolved(path) in seen:
            raise FileError(f"{path}: named twice; a recording counts once")
        seen.add(resolved(path))


def check_file(out: Path, read: Iterable[Path] = ()) -> None:
    """Raise `FileError` unless a file can be written here, and is none of those that are read."""
    if not out.parent.is_dir():
        raise FileError(f"{out}: there is no folder {out.parent}")
    if out.is_dir():
        raise FileError(f"{out}: is a folder; name a file")
    if resolved(out) in {resolved(path) for path in read}:
        raise FileError(f"{out}: is read by this command and would be lost; write another file")
    _check_access(out, out if out.exists() else out.parent)


def check_folder(out: Path) -> None:
    """Raise `FileError` unless a folder is here, or can be made, to write in; its name goes into files and pages."""
    try:
        str(out).encode()
    except UnicodeEncodeError:
        raise FileError(f"{str(out)!r}: its name is no text in UTF-8; name another folder") from None
    there = next(place for place in (out, *resolved(out).parents) if place.exists())
    if not there.is_dir():
        raise FileError(f"{out}: {there} is a file; name a folder")
    _check_access(out, there)


def _check_access(out: Path, place: Path) -> None:
    if not os.access(place, os.W_OK):
        raise FileError(f"{out}: no permission to write {place}")
