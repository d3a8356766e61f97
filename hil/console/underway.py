"""Runs that are under way in the folder of runs, whoever started them, and what became of them."""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal
from urllib.parse import urlsplit

from hil.bench.stop.consoles import LOOPBACK, consoles
from hil.bench.stop.control import CONTROL_FILE
from hil.bench.stop.press import MOST_BYTES
from hil.errors import FileError
from hil.record.run_folder.header import END_FILE, HEADER_FILE, Header, read_end, read_header
from hil.record.run_folder.process_liveness import is_alive
from hil.record.run_folder.samples import JOURNAL_FILE
from hil.record.simulated import SIMULATED, is_simulated
from hil.untrusted import is_regular, read_untrusted_json

State = Literal["running", "lost", "ended"]

_FRESH_S = 0.1  # what was seen so lately is told again
_ENDED_S = 3.0  # so long a run that has ended is still told
_SILENT_S = 15.0  # a run whose process nobody knows and that has written nothing for so long has been lost


@dataclass(frozen=True, slots=True)
class Run:
    """A run that is not closed, or was not when it was seen last.

    Attributes:
        folder: of it.
        state: `lost` when its process is gone and the folder was not closed.
        outcome: how it ended, in its own words; empty before.
        meta: of its header.
        control: how it is stopped and held (`control.json`); empty while it says nothing of that.
        is_safe: whether it has ended with every output read back safe.
    """

    folder: Path
    state: State
    outcome: str
    meta: Mapping[str, Any]
    control: Mapping[str, Any]
    is_safe: bool = False

    @property
    def for_page(self) -> dict[str, Any]:
        """For a page: what the run is, and where it is stopped."""
        valve = self.meta.get("valve") or {}
        return {
            "run": self.folder.name, "state": self.state, "outcome": self.outcome,
            "procedure": self.meta.get("procedure") or "", "bench": self.meta.get("bench") or "",
            "serial": valve.get("serial") or "", "operator": self.meta.get("operator") or "",
            "is_safe": self.is_safe, SIMULATED: is_simulated(self.meta),
            **{key: self.control[key] for key in _OF_CONTROL if key in self.control},
        }  # fmt: skip


_OF_CONTROL = ("listener", "stop_url", "stop_urls", "token")


def run_of(folder: Path, pid: int | None = None) -> Run:
    """How a run stands.

    Args:
        folder: of the run.
        pid: of its process, where the console started it.

    Raises:
        FileError: not a run folder.
    """
    header, end, control = _header(folder, _written(folder)), read_end(folder), control_of(folder)
    if end is not None:
        outputs = end.meta.get("outputs") or {}
        safe = bool(outputs) and all(one.get("state") == "safe" for one in outputs.values())
        return Run(folder, "ended", end.outcome, header.meta, control, safe)
    known = control.get("pid", pid)
    alive = is_alive(int(known)) if isinstance(known, int) else _wrote_lately(folder)
    if not alive and (folder / END_FILE).exists():  # closed between the two questions
        return run_of(folder, pid)
    return Run(folder, "running" if alive else "lost", "", header.meta, control)


@lru_cache(maxsize=64)
def _header(folder: Path, _written: tuple[int, ...]) -> Header:
    """It is written once, and every page asks for it."""
    return read_header(folder)


def _written(folder: Path) -> tuple[int, ...]:
    """Another one for another header of a folder."""
    with suppress(OSError):
        found = (folder / HEADER_FILE).lstat()
        return found.st_ino, found.st_mtime_ns, found.st_size
    return ()


def control_of(folder: Path) -> Mapping[str, Any]:
    """What the run says of how it is stopped, on this computer; empty where it says nothing that can be read."""
    try:
        content = read_untrusted_json(folder, CONTROL_FILE, MOST_BYTES)
    except (OSError, FileError):
        return {}
    if not isinstance(content, dict) or content.get("schema") != "hil.control/1":
        return {}
    urls = content.get("stop_urls")
    urls = [url for url in urls if isinstance(url, str) and _is_here(url)] if isinstance(urls, list) else []
    content = {key: value for key, value in content.items() if key == "pid" or isinstance(value, str)}
    return {**content, "stop_urls": urls} if _is_here(str(content.get("stop_url", ""))) else {}


def _is_here(url: str) -> bool:
    """Whether an address is one at which a run of this computer may listen."""
    with suppress(ValueError):
        host = urlsplit(url).hostname
        return host in LOOPBACK or any(host == console.host for console in consoles())
    return False


def _wrote_lately(folder: Path) -> bool:
    newest = 0.0
    for name in (JOURNAL_FILE, HEADER_FILE):
        with suppress(OSError):
            newest = max(newest, (folder / name).stat().st_mtime)
    return time.time() - newest < _SILENT_S


@dataclass(slots=True)
class Underway:
    """Finds runs that are not closed; a folder is looked at anew only when its list of entries has changed.

    Attributes:
        runs: the folder in which runs lie.
    """

    runs: Path
    _seen_ns: int = field(default=-1, init=False)
    _known: set[str] = field(default_factory=set, init=False)
    _open: dict[str, Path] = field(default_factory=dict, init=False)
    _ended_s: dict[str, float] = field(default_factory=dict, init=False)
    _last: list[Run] = field(default_factory=list, init=False)
    _looked_s: float = field(default=-math.inf, init=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, init=False)

    def look(self, anew: bool = False) -> list[Run]:
        """Runs under way, the newest last; those that have just ended or were lost are told for a moment longer.

        Args:
            anew: as of now, also where somebody has just looked.
        """
        with self._lock:
            if anew or time.monotonic() - self._looked_s >= _FRESH_S:  # many pages ask
                self._last, self._looked_s = self._look(), time.monotonic()
            return self._last

    def _look(self) -> list[Run]:
        self._find_new()
        found = []
        for name, folder in list(self._open.items()):
            try:
                run = run_of(folder)
            except FileError:  # deleted, its header is being written, or it is none of ours
                if not _wrote_lately(folder):
                    del self._open[name]
                continue
            if self._is_over(name, run):
                del self._open[name]
                continue
            found.append(run)
        return sorted(found, key=lambda run: run.folder.stat().st_ctime_ns if run.folder.exists() else 0)

    def _is_over(self, name: str, run: Run) -> bool:
        """Whether a run is not to be told again: nobody listens for it, and it has not just ended."""
        if run.state == "running" or run.control:
            self._ended_s.pop(name, None)
            return False
        return time.monotonic() - self._ended_s.setdefault(name, time.monotonic()) > _ENDED_S

    def _find_new(self) -> None:
        try:
            changed_ns = self.runs.stat().st_mtime_ns
        except OSError:
            return
        if changed_ns == self._seen_ns:
            return
        fresh = time.time_ns() - changed_ns < 2_000_000_000  # the clock of a file system may stand that long
        with os.scandir(self.runs) as entries:
            for entry in entries:
                new = entry.name not in self._known and not entry.name.startswith(".")  # one that is being made
                if new and entry.is_dir(follow_symlinks=False):
                    self._take_run(entry.name)
        self._seen_ns = -1 if fresh else changed_ns

    def _take_run(self, name: str) -> None:
        folder = self.runs / name
        if not is_regular(self.runs, f"{name}/{HEADER_FILE}"):
            return  # not yet a run, or none
        self._known.add(name)
        if not (folder / END_FILE).exists() and (_wrote_lately(folder) or control_of(folder)):
            self._open[name] = folder
