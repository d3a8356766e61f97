"""Text files whatever their encoding, compressed or not."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from io import TextIOWrapper
from itertools import islice
from pathlib import Path
from typing import IO, Literal

from hil.errors import FileError
from hil.untrusted import most_unpacked, unpacked_allowed

_MOSTLY = 0.8
_START_BYTES = 1 << 16
_LINES = 600
_GZIP_LEVEL = 3  # noise shrinks by 3 % more at level 9, for more than twice the time


def open_text(path: Path, encoding: str, mode: Literal["rt", "wt"] = "rt") -> IO[str]:
    """A text file, compressed or not; bytes that are no text in a remark do no harm."""
    errors = "replace" if mode == "rt" else "strict"
    if mode == "rt" and is_packed(path):
        return TextIOWrapper(Unpacked(path), encoding, errors)
    if mode == "wt" and path.suffix.lower() == ".gz":
        return gzip.open(path, mode, _GZIP_LEVEL, encoding=encoding, errors=errors)
    return path.open(mode, encoding=encoding, errors=errors)


class PackedError(FileError):
    """A compressed file that is damaged, or unpacks to more than is read: nothing more is looked for in it."""


class Unpacked(gzip.GzipFile):
    """A compressed file, read as far as a recording can go: measured values shrink to a tenth, not to a thousandth."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "rb")
        self._path, self._packed = path, path.stat().st_size
        self._most = most_unpacked(self._packed)

    def read(self, size: int | None = -1) -> bytes:
        """So many bytes. Raises `FileError` beyond what is read."""
        return self._checked(super().read, self._most + 1 if size is None or size < 0 else size)

    def read1(self, size: int = -1) -> bytes:
        """As many bytes as are there. Raises `FileError` beyond what is read."""
        return self._checked(super().read1, size)

    def _checked(self, read: Callable[[int], bytes], size: int) -> bytes:
        try:
            found = read(size)
        except (EOFError, OSError, zlib.error) as error:
            raise PackedError(f"{self._path}: cannot be unpacked: {error}") from None
        if self.tell() > self._most:
            raise PackedError(f"{self._path}: unpacks to more than is read; {unpacked_allowed(self._packed)}")
        return found


def is_packed(path: Path) -> bool:
    """Whether a file is compressed by gzip, whatever its name says."""
    with path.open("rb") as file:
        return file.read(2) == b"\x1f\x8b"


@dataclass(frozen=True, slots=True)
class Beginning:
    """The first lines of a text file, without their ends; `is_whole`: there are no others."""

    path: Path
    encoding: str
    lines: list[str]
    is_whole: bool


def beginning_of(path: Path) -> Beginning:
    """The lines by which a text file is known; raises as `encoding_of`."""
    encoding = encoding_of(path)
    with open_text(path, encoding) as file:
        lines = [line.rstrip("\r\n") for line in islice(file, _LINES)]
        return Beginning(path, encoding, lines, not file.readline())


def encoding_of(path: Path) -> str:
    """UTF-8 or UTF-16; what spreadsheets write in Western Europe where the beginning is no UTF-8.

    Raises:
        FileError: bytes that no text has.
    """
    with Unpacked(path) if is_packed(path) else path.open("rb") as file:
        start = file.read(_START_BYTES)
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if b"\0" in start.rstrip(b"\0"):  # at the end: room that a logger had kept when its power went
        for encoding, zeros in (("utf-16-le", start[1::2]), ("utf-16-be", start[::2])):
            if zeros.count(0) > _MOSTLY * len(zeros):
                return encoding
        raise FileError(f"{path}: holds bytes that no text has; is its name right?")
    if len(start) == _START_BYTES and not (b"\n" in start or b"\r" in start):
        raise FileError(f"{path}: its first line is longer than {_START_BYTES} bytes; is it a table?")
    whole = start[: start.rfind(b"\n") + 1] or start
    try:
        whole.decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"
