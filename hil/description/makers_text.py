"""Makers' files: register tables, EDS, DCF and DBC."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

from hil.errors import FileError, reading, reason
from hil.untrusted import read_small

_T = TypeVar("_T")


def makers_text(data: bytes) -> str:
    """What stands in a file: UTF-8, else the Windows code page of makers' editors; with plain ends of lines."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def makers_file(kind: str, understood: Callable[[bytes], _T]) -> Callable[[str], _T]:
    """A reader of files of a kind by their path, which reads one again only when it has changed.

    Args:
        kind: in words, `an EDS or DCF`.
        understood: makes of the bytes of a file what stands in it.

    Returns:
        The reader. It raises `FileError` for a file that cannot be read, or is not of that kind.
    """

    @lru_cache(maxsize=32)
    def read(path: str, _changed: int) -> _T:
        data = read_small(Path(path))
        try:
            return understood(data)
        except Exception as error:  # a library raises what its parsers do
            raise FileError(f"{path}: not {kind}: {reason(error)}") from None

    def reader(path: str) -> _T:
        with reading(path, remedy="; it is looked for beside the file that names it"):
            return read(path, Path(path).stat().st_mtime_ns)

    return reader
