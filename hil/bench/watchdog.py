"""The watchdog: a process of its own that makes outputs safe when the program that drives a bench dies or hangs.

    python -m hil.bench.watchdog BENCH.toml PID RUN

It hears the program through a pipe, a byte for each sign of life, and answers each. Before anything moves it opens
its own way to the devices once and makes their outputs safe, so that this way is known to work. From then on it does
not touch them, until the pipe ends without a farewell (the program is dead) or is silent for too long while outputs
are driven (it hangs: then the watchdog kills it first, so that it cannot wake up and go on). What it did stands in
`watchdog.json` in the run folder.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from hil.bench.heartbeat import ANSWER, AT_REST, FAREWELL, GIVE_UP_S, READY, REPORT_FILE
from hil.bench.lease import leased
from hil.bench.read import BenchFile, read_bench
from hil.errors import HardwareError, HilError, InUseError

_AGAIN_S = 0.05
_RELEASE_S = 2.0  # the system needs a moment to end a killed process, its lease and its hold on serial ports


def main(path: str, pid: str, run: str) -> int:
    """Watch a program; returns the exit status."""
    try:
        file = read_bench(Path(path))
        _make_all_safe(file)
    except HilError as error:
        _say(f"error {' '.join(str(error).split())}\n".encode())
        return error.exit_status
    _say(READY)
    limit_s = file.bench.protection.watchdog_s
    why = _watched(_Ears(), limit_s, int(pid))
    if why:
        _act(file, int(pid), Path(run), why)
    return 0


class _Ears:
    """What the program says, read in a thread of its own so that it can be waited for with a limit everywhere."""

    def __init__(self) -> None:
        self._heard: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        threading.Thread(target=self._listen, daemon=True).start()

    def next(self, timeout_s: float | None) -> bytes | None:
        """What came; nothing at the end of the pipe, None when nothing came in time."""
        try:
            return self._heard.get(timeout=timeout_s)
        except queue.Empty:
            return None

    def _listen(self) -> None:
        while said := os.read(0, 4096):
            self._heard.put(said)
        self._heard.put(b"")


def _watched(ears: _Ears, limit_s: float, pid: int) -> str:
    """Listen until there is something to do; empty when the program said farewell."""
    driven = False
    while True:
        said = ears.next(limit_s if driven else None)
        if said is None:
            with suppress(ProcessLookupError):
                os.kill(pid, getattr(signal, "SIGKILL", signal.SIGTERM))
            deadline_s = time.monotonic() + _RELEASE_S
            while ears.next(max(0.0, deadline_s - time.monotonic())):
                pass
            return f"gave no sign of life for {limit_s:g} s while outputs were driven, and was killed"
        if not said:
            return "ended without making its outputs safe"
        if FAREWELL in said:
            return ""
        driven = said[-1:] != AT_REST
        _say(ANSWER * len(said))


def _act(file: BenchFile, pid: int, run: Path, why: str) -> None:
    begun_s = time.monotonic()
    try:
        with _lease_of_the_dead(file, pid):
            left = _made_safe_with_patience(file, begun_s)
    except InUseError as taken:  # whoever took it has made its outputs safe on opening it
        _report(run, {"why": why, "left_alone": str(taken)}, f"process {pid} {why}; {taken}")
        return
    took_s = round(time.monotonic() - begun_s, 3)
    if left:
        text = f"process {pid} {why}; NOT SAFE: {'; '.join(left)}"
        _report(run, {"why": why, "not_safe": left, "tried_s": took_s}, text)
    else:
        _report(run, {"why": why, "safe_after_s": took_s}, f"process {pid} {why}; outputs made safe in {took_s:g} s")


@contextmanager
def _lease_of_the_dead(file: BenchFile, pid: int) -> Iterator[None]:
    """The lease on the bench, as soon as the system has taken it from the dead program.

    A program that does not die keeps it; then it goes on without: outputs matter more than order.
    """
    deadline_s = time.monotonic() + _RELEASE_S
    with ExitStack() as held:
        while time.monotonic() < deadline_s:
            try:
                held.enter_context(leased(file))
                break
            except InUseError as taken:
                if taken.pid not in (pid, None):
                    raise
            time.sleep(0.01)
        yield


def _made_safe_with_patience(file: BenchFile, begun_s: float) -> list[str]:
    """Make every device safe, each as soon as it can be reached; why some could not be."""
    left = dict.fromkeys(file.devices, "")
    while left:
        for name in list(left):
            try:
                _make_safe(file, name)
            except HardwareError as error:
                left[name] = f"{name}: {error}"
            else:
                del left[name]
        if time.monotonic() - begun_s > GIVE_UP_S:
            break
        if left:
            time.sleep(_AGAIN_S)
    return list(left.values())


def _make_all_safe(file: BenchFile) -> None:
    for name in file.devices:
        _make_safe(file, name)


def _make_safe(file: BenchFile, name: str) -> None:
    """Open a device with its outputs alone, so that no sensor can keep it from being made safe."""
    outputs = {channel: entry for channel, entry in file.bench.channels.items() if entry.is_output}
    if any(entry.device == name for entry in outputs.values()):
        daq = file.devices[name].open(outputs)
        try:
            daq.make_safe()
        finally:
            daq.close()


def _report(run: Path, told: dict[str, object], text: str) -> None:
    with suppress(OSError):
        (run / REPORT_FILE).write_text(json.dumps(told, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    with suppress(OSError):
        print(f"hil watchdog: {text}", file=sys.stderr, flush=True)


def _say(what: bytes) -> None:
    with suppress(OSError):  # nobody listens any more
        os.write(1, what)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
