"""The disk of a world: what writing to it comes to, what a power cut leaves of it, and a sector that reads wrong."""

from __future__ import annotations

import errno
import os
import random
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from hil.record.run_folder.events import EVENTS_FILE
from hil.record.run_folder.header import END_FILE, HEADER_FILE
from hil.record.run_folder.samples import JOURNAL_FILE, ROWS_FILE

SECTOR = 512


class Disk:
    """Takes what is written, and has it for good once it is synced.

    Args:
        draw: of where a write tears, and of what a power cut leaves.
        sleep: lets time go by.
        now_s: what time it is.

    Attributes:
        fails: the error number of every write, after a drawn part of it; 0: none. Without a disk a sync fails too.
        slow_s: so long every write and sync takes.
        cut_s: when the power was cut; None: never.
        waited_s: how long what was lost then had waited for a sync.
    """

    def __init__(self, draw: random.Random, sleep: Callable[[float], None], now_s: Callable[[], float]) -> None:
        self._draw, self._sleep, self._now_s = draw, sleep, now_s
        self.fails, self.slow_s = 0, 0.0
        self.cut_s: float | None = None
        self.waited_s = 0.0
        self._synced: dict[int, int] = {}  # bytes of each file that are there for good
        self._since_s: dict[int, float] = {}  # since when some wait for that

    def write(self, file: Any, data: Any) -> int:
        self._sleep(self.slow_s)
        place = os.fstat(file.fileno()).st_ino
        self._since_s.setdefault(place, self._now_s())
        taken = self._draw.randrange(len(data)) if self.fails else len(data)
        file.write(data[:taken])
        if self.fails and (self.fails != errno.ENOSPC or not taken):
            raise OSError(self.fails, os.strerror(self.fails), str(getattr(file, "name", "")))
        return taken  # one that is full takes less and less

    def sync(self, descriptor: int) -> None:
        before, begun_s = os.fstat(descriptor), self._now_s()
        self._sleep(self.slow_s)
        if self.fails == errno.EIO:
            raise OSError(self.fails, os.strerror(self.fails))
        self._synced[before.st_ino] = before.st_size
        if self._since_s.pop(before.st_ino, None) and os.fstat(descriptor).st_size > before.st_size:
            self._since_s[before.st_ino] = begun_s

    def cut(self, folder: Path) -> None:
        """The power is gone: of what was not synced a drawn part is there, and a sector of it may be none."""
        self.cut_s = self._now_s()
        for path, place in _files(folder):
            size, synced = path.stat().st_size, self._synced.get(place, 0)
            if place in self._since_s:
                self.waited_s = max(self.waited_s, self.cut_s - self._since_s[place])
            if size <= synced:
                continue
            kept = self._draw.randint(synced, size)
            with path.open("r+b") as file:
                file.truncate(kept)
                if kept > synced and self._draw.random() < 0.3:
                    file.seek(at := self._draw.randrange(synced, kept))
                    file.write(bytes(min(SECTOR, kept - at)))

    def synced(self, path: Path) -> int:
        """So many bytes of a file were there for good."""
        return self._synced.get(path.stat().st_ino, 0)


def _files(folder: Path) -> Iterator[tuple[Path, int]]:
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            yield path, path.stat().st_ino


def spoil(folder: Path, draw: random.Random) -> str:
    """One sector of one file of a run folder reads wrong; the name of the file, empty where none was changed."""
    names = [HEADER_FILE, EVENTS_FILE, ROWS_FILE, JOURNAL_FILE, END_FILE]
    name = draw.choice([one for one in names if (folder / one).exists()])
    content = bytearray((folder / name).read_bytes())
    if not content:
        return ""
    at = SECTOR * draw.randrange(-(-len(content) // SECTOR))
    length = min(SECTOR, len(content) - at)
    wrong = draw.choice((bytes(length), draw.randbytes(length)))
    changed = content[at : at + length] != wrong
    content[at : at + length] = wrong
    (folder / name).write_bytes(content)
    return name if changed else ""
