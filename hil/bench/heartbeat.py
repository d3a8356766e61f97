"""The heartbeat: how a program that drives a bench tells its watchdog that it lives (see `hil.bench.watchdog`)."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from hil.bench.read import BenchFile
from hil.errors import DeviceLostError, HardwareError, StoppedError

READY, DRIVEN, AT_REST, FAREWELL, ANSWER = b"ready\n", b"d", b"s", b"q", b"."
REPORT_FILE = "watchdog.json"
GIVE_UP_S = 60.0  # so long a watchdog tries to reach a device
_START_S = 60.0
_FAREWELL_S = 10.0


@contextmanager
def watched(file: BenchFile, run: Path) -> Iterator[Callable[[bool], None]]:
    """A watchdog process while inside; yields the function that gives a sign of life.

    That function is told whether outputs are driven (else they are safe), and raises `StoppedError` when the watchdog
    itself is gone or hangs. A simulated bench, and one whose file says `watchdog_s = 0`, has no watchdog.

    Raises:
        HardwareError: the watchdog cannot reach the devices.
    """
    if file.is_simulated or not file.bench.protection.watchdog_s:
        yield lambda _driven: None
        return
    heart = Heart(file, run)
    heart.wait_until_ready()
    try:
        yield heart.beat
    except DeviceLostError as lost:  # outputs that could not be reached: the watchdog goes on trying
        heart.stop()
        raise DeviceLostError(
            f"{lost}; the watchdog process goes on trying for {GIVE_UP_S:g} s and tells what came of it here and in "
            f"{run / REPORT_FILE}"
        ) from lost
    except BaseException:
        heart.say_farewell()
        raise
    heart.say_farewell()


class Heart:
    """The watchdog process of a run, as seen from the run.

    Args:
        file: the bench that it watches over.
        run: the run folder, for its report.
    """

    def __init__(self, file: BenchFile, run: Path) -> None:
        self._limit_s = file.bench.protection.watchdog_s
        command = [sys.executable, "-m", "hil.bench.watchdog", str(file.path), str(os.getpid()), str(run)]
        # A session of its own: a Ctrl-C or a closed terminal reaches the run alone.
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0, start_new_session=True
        )
        self._started = threading.Event()
        self._failed = ""
        self._heard_s = self._asked_s = time.monotonic()
        threading.Thread(target=self._listen, name="hil-watchdog", daemon=True).start()

    def wait_until_ready(self) -> None:
        """Return when the watchdog has made the outputs safe once, by its own way.

        Raises:
            HardwareError: it could not.
        """
        if not self._started.wait(_START_S) or self._failed:
            self.stop()
            self._process.kill()
            self._process.wait()
            raise HardwareError(f"the watchdog process: {self._failed or f'not ready within {_START_S:g} s'}")

    def beat(self, driven: bool) -> None:
        """Give a sign of life.

        Raises:
            StoppedError: the watchdog does not answer any more.
        """
        now_s = time.monotonic()
        if self._failed or (self._asked_s > self._heard_s and now_s - self._asked_s > self._limit_s):
            raise self._gone()
        if self._asked_s <= self._heard_s:
            self._asked_s = now_s  # the oldest sign of life that is not answered yet
        try:
            self._say(DRIVEN if driven else AT_REST)
        except OSError:
            raise self._gone() from None

    def say_farewell(self) -> None:
        """Let the watchdog end; outputs are safe."""
        try:
            self._say(FAREWELL)
            self.stop()
            self._process.wait(_FAREWELL_S)
        except (OSError, subprocess.TimeoutExpired):
            self._process.kill()
            self._process.wait()

    def stop(self) -> None:
        """Leave the watchdog alone: it takes the program for dead and does its work."""
        if self._process.stdin is not None:
            self._process.stdin.close()

    def _gone(self) -> StoppedError:
        how = self._failed or f"gave no answer for {self._limit_s:g} s"
        return StoppedError(f"the watchdog process {how}; the run was stopped, outputs are safe")

    def _say(self, what: bytes) -> None:
        pipe = self._process.stdin
        if pipe is None or pipe.closed:
            raise BrokenPipeError
        pipe.write(what)

    def _listen(self) -> None:
        with self._process, self._process.stdout as said:  # type: ignore[union-attr] # it is a pipe
            self._hear(said)

    def _hear(self, said: IO[bytes]) -> None:
        first = said.readline()
        self._failed = "" if first == READY else first.decode(errors="replace").removeprefix("error ").strip() or "died"
        self._heard_s = self._asked_s = time.monotonic()
        self._started.set()
        while said.read(4096):
            self._heard_s = time.monotonic()
        self._failed = self._failed or "ended"
