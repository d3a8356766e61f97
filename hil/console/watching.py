"""Inputs read while no run drives the bench: by `hil watch` as a process of its own, for as long as a page looks on."""

from __future__ import annotations

import json
import subprocess
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hil.bench.manual.reading import Reading
from hil.child import Process, child
from hil.errors import storing

EVERY_S = 0.5
_NOBODY_S = 15.0  # so long after the last page asked it ends


@dataclass(slots=True)
class _Watch:
    process: Process[str]
    asked_s: float
    latest: dict[str, Any] = field(default_factory=dict)
    latest_s: float = 0.0
    message: str = ""
    is_over: bool = False  # nobody looked any more


class Watching:
    """At most one process for each bench. It holds the bench's lease: a run that starts here ends it first."""

    def __init__(self) -> None:
        self._watches: dict[str, _Watch] = {}
        self._lock = threading.Lock()

    def begin(self, bench: str, path: Path) -> None:
        """Read the inputs of a bench from now on.

        Raises:
            StorageError: the process cannot be started.
        """
        with self._lock:
            if bench in self._watches and self._watches[bench].process.poll() is None:
                return
            with storing(path, "its inputs cannot be watched"):
                process = child(
                    "hil", ["watch", str(path), "--lines", "--every", str(EVERY_S)],
                    stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, bufsize=1,
                )  # fmt: skip
            watch = self._watches[bench] = _Watch(process, time.monotonic())
        threading.Thread(target=self._follow, args=(watch,), name="hil-console-watch", daemon=True).start()

    def end(self, bench: str) -> None:
        """Read them no longer; returns when the lease is free."""
        with self._lock:
            watch = self._watches.pop(bench, None)
        if watch is not None:
            _ended(watch.process)

    def close(self) -> None:
        """End all."""
        for bench in list(self._watches):
            self.end(bench)

    def readings(self, bench: str) -> tuple[list[Reading], str, bool]:
        """(readings, what keeps them from coming, whether somebody reads); asking keeps it going."""
        with self._lock:
            watch = self._watches.get(bench)
        if watch is None:
            return [], "", False
        watch.asked_s = time.monotonic()
        lives = watch.process.poll() is None
        late_s = time.monotonic() - watch.latest_s
        readings = [_reading(row, late_s) for row in watch.latest.get("channels", [])]
        return readings, "" if lives or watch.is_over else (watch.message or "the inputs are not read any more"), lives

    def _follow(self, watch: _Watch) -> None:
        for line in watch.process.stdout or ():
            try:
                watch.latest, watch.latest_s = json.loads(line), time.monotonic()
            except ValueError:
                watch.message = line.strip()
            if time.monotonic() - watch.asked_s > _NOBODY_S:
                watch.is_over = True
                _ended(watch.process)
        watch.process.wait()


def _reading(row: dict[str, Any], late_s: float) -> Reading:
    return Reading(**{**row, "age_s": row["age_s"] + max(0.0, late_s - 2.0 * EVERY_S)})


def _ended(process: Process[str]) -> None:
    process.terminate()
    try:
        process.wait(5.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
