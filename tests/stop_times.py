"""How long a stop takes, from the POST to what an observer reads at the device: one run after another, many times.

    python -m tests.stop_times --stops 100 --how work|killed|hung [--viewers 20]

The devices are served by a process of their own, the console is one, its viewers are one, and each run is one with a
watchdog process beside it. The observer speaks raw bytes to the device and shares no code with any of them.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tests import observer
from tests.links import bench_text, devices_of, moved
from tests.stops import posted
from tests.waits import PATIENCE_S, until

How = Literal["work", "killed", "hung"]
SAFE_PERCENT, DRIVEN_PERCENT = 0.6, 39.0
STAYS_S = 0.2
HALTED = 138
# The coupler's own watchdog stays off, so that only the program and its watchdog process can make it safe.
CHANGES = (("\nwatchdog_s = 1.0\n", "\n"), ("block_s = 0.1\n", "block_s = 0.1\nwatchdog_s = 10.0\n"))


@dataclass(frozen=True, slots=True)
class Stopped:
    """One stop: when the device stood safe and when the answer came, after the POST; and what the answer was."""

    safe_s: float
    answered_s: float
    answer: dict[str, Any]


def stops(count: int, how: How, viewers: int, told: Callable[[Stopped], None] = lambda _one: None) -> list[Stopped]:
    """So many runs, each stopped while it stands at 40 %."""
    with ExitStack() as stack:
        # the watchdog of the last run may still write its report
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(ignore_cleanup_errors=True)))
        path = folder / "bench.toml"
        path.write_text(moved(bench_text("hpv41-modbus-tcp", *CHANGES), folder), encoding="utf-8")
        stack.enter_context(devices_of(path))
        look = observer.modbus_tcp(_port_in(path.read_text(encoding="utf-8")))
        environment = {**os.environ, "HIL_STATE_DIR": str(folder / "state"), "HIL_ARCHIVE": str(folder / "runs")}
        (folder / "runs").mkdir()
        console = stack.enter_context(_console(environment)) if viewers else None
        if console is not None:
            stack.enter_context(_viewers(console[1], viewers))
        words = [sys.executable, "-m", "tests.stop_times", "--drive", str(path), str(folder / "runs"), str(count)]
        runs = stack.enter_context(subprocess.Popen(words, env=environment))
        stack.callback(runs.kill)
        found = []
        for number in range(count):
            one = _stopped(folder / "runs" / f"run-{number}", how, look, console[0] if console else None)
            told(one)
            found.append(one)
        return found


def _stopped(run: Path, how: How, look: Callable[[], float], console: subprocess.Popen[bytes] | None) -> Stopped:
    until(lambda: _is_driven(look) and (run / "control.json").exists(), every_s=0.01)
    control = json.loads((run / "control.json").read_text())
    time.sleep(0.15)
    if how == "hung":
        os.kill(control["pid"], signal.SIGSTOP)
    if how == "killed" and console is not None and console.poll() is None:
        console.kill()
        console.wait()
    answers: list[tuple[float, dict[str, Any]]] = []

    def press() -> None:
        try:
            answer = posted(control["stop_url"], {"token": control["token"]})[1]
        except (OSError, ValueError, IndexError) as error:  # hung up on
            answer = {"state": f"no answer ({error!r})", "by": "nobody"}
        answers.append((time.monotonic(), answer))

    pressing = threading.Thread(target=press)
    begun_s = time.monotonic()
    pressing.start()
    safe_s = 0.0
    while not safe_s or time.monotonic() - safe_s < STAYS_S or pressing.is_alive():
        level = look()
        now_s = time.monotonic()
        if abs(level) > SAFE_PERCENT:
            assert not safe_s, f"it was safe, and then stood at {level:g} %"
            assert now_s - begun_s < PATIENCE_S, "it never became safe"
        elif not safe_s:
            safe_s = now_s
    pressing.join()
    return Stopped(safe_s - begun_s, answers[0][0] - begun_s, answers[0][1])


def _is_driven(look: Callable[[], float]) -> bool:
    with suppress(OSError):
        return look() > DRIVEN_PERCENT
    return False


def _drive(path: Path, runs: Path, count: int) -> None:
    """Run after run in a process of its own each, as `hil run` does; forked from here, where all is imported."""
    from hil.session.preload import preload
    from hil.session.procedure import load_procedure

    preload(load_procedure("jog").run)
    for number in range(count):
        out = runs / f"run-{number}"
        while (status := _forked(lambda out=out: _driven(path, out))) not in (HALTED, -signal.SIGKILL):
            print(f"{out.name} was not stopped, it ended with status {status}: once more", file=sys.stderr)
            shutil.rmtree(out, ignore_errors=True)
        if status != HALTED:  # its watchdog has the bench until nothing late can come
            until((out / "watchdog.json").exists, every_s=0.01)


def _driven(path: Path, out: Path) -> int:
    """Stand at 40 % until somebody presses stop; the exit status."""
    from hil.bench.open import open_rig
    from hil.bench.read import read_bench
    from hil.errors import HilError
    from hil.safety.interrupt import Halted, terminable
    from hil.safety.operator import Operator

    try:
        with terminable(), open_rig(read_bench(path), out, {}, lambda _d, _t: None, operator=Operator()) as rig:
            while True:
                rig.play(np.full(3000, 40.0))
    except Halted:
        return HALTED
    except HilError as error:
        print(f"{out.name}: {error}", file=sys.stderr)
        return error.exit_status


def _forked(drive: Callable[[], int]) -> int:
    child = os.fork()
    if not child:
        status = 3
        try:
            status = drive()
        finally:
            os._exit(status)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


@contextmanager
def _console(environment: dict[str, str]) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    words = [sys.executable, "-u", "-m", "hil", "console", "--port", "0"]
    with subprocess.Popen(words, env=environment, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        address = process.stdout.readline().decode().split()[2]
        try:
            yield process, address
        finally:
            process.kill()


@contextmanager
def _viewers(address: str, count: int) -> Iterator[None]:
    words = [sys.executable, "-m", "tests.stop_times", "--view", address, str(count)]
    with subprocess.Popen(words) as process:
        try:
            yield
        finally:
            process.kill()


def _view(address: str, count: int) -> None:
    """Plain clients that look as a page does: what is under way, and the stream of the run."""
    from http.client import HTTPException
    from urllib.request import urlopen

    def look() -> None:
        while True:
            with suppress(OSError, ValueError, IndexError, HTTPException):
                with urlopen(f"{address}controls", timeout=2.0) as told:
                    runs = [run["run"] for run in json.loads(told.read())["runs"] if run["state"] == "running"]
                with urlopen(f"{address}live/{runs[-1]}/stream", timeout=2.0) as stream:
                    until_s = time.monotonic() + 2.0
                    while time.monotonic() < until_s and stream.read1(65536):
                        pass
            time.sleep(0.4)

    for _ in range(count):
        threading.Thread(target=look, daemon=True).start()
    threading.Event().wait()


def _port_in(text: str) -> int:
    return int(text.partition("127.0.0.1:")[2].partition('"')[0])


def distribution(found: Sequence[Stopped]) -> str:
    """In ms: when the device stood safe, and when the answer came."""
    lines = []
    for name in ("safe_s", "answered_s"):
        values = 1e3 * np.array([getattr(one, name) for one in found])
        told = ", ".join(f"p{share} {np.percentile(values, share):.0f}" for share in (5, 50, 90, 99))
        lines.append(f"{name.removesuffix('_s')}: {told}, largest {values.max():.0f} ms of {len(values)}")
    by = sorted({f"{one.answer['state']} by {one.answer['by']}" for one in found})
    return "; ".join([*lines, ", ".join(by)])


def main() -> None:
    """See the head of this file."""
    if "--drive" in sys.argv:
        _drive(Path(sys.argv[2]), Path(sys.argv[3]), int(sys.argv[4]))
        return
    if "--view" in sys.argv:
        _view(sys.argv[2], int(sys.argv[3]))
        return
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stops", type=int, default=100)
    parser.add_argument("--how", choices=("work", "killed", "hung"), default="work")
    parser.add_argument("--viewers", type=int, default=20)
    asked = parser.parse_args()
    print(distribution(stops(asked.stops, asked.how, asked.viewers)))


if __name__ == "__main__":
    main()
