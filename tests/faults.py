"""What is seen at a device of a fault that is made on purpose while a bench is driven."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil.errors import FileError
from hil.record.folder import read
from tests.observer import Watch
from tests.waits import until

STRANGER = Path(__file__).parent / "stranger"


@dataclass(frozen=True, slots=True)
class Case:
    """A fault at a moment on a link, and what is promised: safe within so long, and what the operator reads.

    `within_s` None: the outputs cannot be reached, and the message says where they stand.
    """

    link: str
    fault: str
    moment: str
    within_s: float | None
    says: str

    def __str__(self) -> str:
        return f"{self.link}, {self.fault}, {self.moment}"


@dataclass(frozen=True, slots=True)
class Seen:
    """What happened.

    Attributes:
        safe_after_s: from the fault until the output was safe at the device, for good; None: it was not.
        lost: samples that the device gave and the recording does not have; None where nobody can count them.
        message: what the operator read.
        status: with which exit status it ended.
        samples: in the run folder, read back.
    """

    safe_after_s: float | None
    lost: int | None
    message: str
    samples: int
    status: int


class Observer(Watch):
    """Looks at an output at the device itself every millisecond, whatever the program says."""

    def __init__(self, served: Mapping[str, Any]) -> None:
        field = next(iter(served.values())).side.field
        super().__init__(lambda: float(field.levels["command"]), 0.0, 0.001)

    def wait_until_driven(self, process: subprocess.Popen[str] | None = None) -> None:
        """Return when the output has left zero."""
        until(lambda: self.now or (process is not None and process.poll() is not None), every_s=0.002)
        assert self.now, f"the run ended early: {process and process.communicate()}"

    def safe_after(self, since_s: float, within_s: float) -> float | None:
        """Seconds from an instant until the output went to zero and stayed there; None when not within this time."""
        stays = self.wait(lambda: self.is_safe and time.monotonic() - self.unsafe_s > 0.2, within_s + 0.2)
        return max(0.0, self.unsafe_s - since_s) if stays else None


def observed(served: Mapping[str, Any]) -> closing[Observer]:
    """An observer while inside."""
    return closing(Observer(served))


def start_run(bench: Path, out: Path, state: Path, *settings: str) -> subprocess.Popen[str]:
    """`hil run tiny_step`, standing at 40 % for a minute, in a process of its own."""
    told = ("levels=40", "hold_s=60", *settings)
    command = [sys.executable, "-m", "hil", "run", "tiny_step", "--bench", str(bench), "--out", str(out)]
    command += [part for setting in told for part in ("--set", setting)]
    environment = {**os.environ, "PYTHONPATH": str(STRANGER), "HIL_STATE_DIR": str(state)}
    return subprocess.Popen(command, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def watchdogs_of(what: object) -> list[int]:
    """The processes that watch over a run: by its process, by its folder, or by one above that."""
    found = []
    for place in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            words = place.read_bytes().decode()
            if "hil.bench.watchdog" in words and (str(what) in words.split("\0") or f"{what}/" in words):
                found.append(int(place.parent.name))
    return found


def watchdog_of(what: object) -> int:
    """The one of them, as soon as it is there."""
    until(lambda: watchdogs_of(what))
    return watchdogs_of(what)[0]


def samples_in(folder: Path) -> int:
    """Samples of a run folder that can be read, however it was left."""
    try:
        return len(read(folder))
    except FileError:
        return 0
