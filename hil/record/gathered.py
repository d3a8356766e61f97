"""A file and those that belong to it, as one: what reads files of others is given a single open file."""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryFile
from typing import BinaryIO

from hil.errors import reading
from hil.untrusted import most_bytes, open_small


def gathered(*parts: bytes) -> BinaryIO:
    """An open file that holds these parts."""
    file = TemporaryFile()  # noqa: SIM115  # who asked for it closes it
    file.write(json.dumps([len(part) for part in parts]).encode() + b"\n")
    file.writelines(parts)
    file.seek(0)
    return file


def parts_of(file: BinaryIO) -> list[bytes]:
    """The parts of such a file, in their order."""
    return [file.read(length) for length in json.loads(file.readline())]


def open_recording(path: Path) -> BinaryIO:
    """A regular file no larger than what is read, open; raises `FileError` for any other."""
    with reading(path):
        return open_small(path, most_bytes())


def whole(path: Path) -> bytes:
    """All of such a file."""
    with open_recording(path) as file:
        return file.read()


def text_of(part: bytes) -> str:
    """Text of a program of today, or of Windows: both codecs are there before files are given up."""
    try:
        return part.decode("utf-8")
    except UnicodeDecodeError:
        return part.decode("latin-1")
