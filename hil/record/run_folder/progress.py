"""`progress.json` in a run folder: how far the run is, for whoever looks on without having started it."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from hil.errors import FileError
from hil.untrusted import read_untrusted_json

Progress = Callable[[float, str], None]
"""Told how far it is: the share done, and what is going on."""

PROGRESS_FILE = "progress.json"
_FLAGS = os.O_WRONLY | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)
_SCHEMA = "hil.progress/1"
_EVERY_S = 0.5
_BYTES = 4096  # one page, which is read as it was written; a file that is renamed may wait for the disk
_LONGEST = 900  # of the text, in characters of up to four bytes


def quiet(_done: float, _text: str) -> None:
    """Say nothing of how far it is."""


@dataclass(frozen=True, slots=True)
class WrittenProgress:
    """What a run said last.

    Attributes:
        share: done, 0 … 1.
        text: what is going on, time left, live values.
        pid: of its process.
    """

    share: float
    text: str
    pid: int


def progress_of(folder: Path) -> WrittenProgress | None:
    """How far the run in a folder says that it is; None where it says nothing that can be read."""
    try:
        written = read_untrusted_json(folder, PROGRESS_FILE, 2 * _BYTES)
        return WrittenProgress(float(written["share"]), str(written["text"]), int(written["pid"]))
    except (OSError, FileError, ValueError, KeyError, TypeError):
        return None


@contextmanager
def kept_progress(folder: Path, progress: Progress) -> Iterator[Progress]:
    """A progress function that also keeps what it is told in the run folder, twice a second, while the run lasts.

    A file that cannot be written hinders no run.
    """
    path, handle, written_s = folder / PROGRESS_FILE, -1, -_EVERY_S

    def report(share: float, text: str) -> None:
        nonlocal handle, written_s
        progress(share, text)
        now_s = time.monotonic()
        if now_s - written_s < _EVERY_S and share < 1.0:
            return
        written_s = now_s
        written = {"schema": _SCHEMA, "share": round(share, 4), "text": text[:_LONGEST], "pid": os.getpid()}
        with suppress(OSError):
            if handle < 0:
                handle = os.open(path, _FLAGS, 0o644)  # noqa: TID251
            os.pwrite(handle, json.dumps(written, ensure_ascii=False).encode().ljust(_BYTES), 0)

    try:
        yield report
    finally:
        with suppress(OSError):
            if handle >= 0:
                os.close(handle)
                path.unlink()
