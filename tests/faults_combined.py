"""A link falls dead while a valve is driven, and then a second thing goes wrong: what is said, and what stands.

python -m tests.faults_combined            prints the table
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import termios
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests import observer
from tests.faults import STRANGER
from tests.links import SELDOM, bench_text, devices_of, moved
from tests.waits import PATIENCE_S

# By link: the bench, the address of the device with the output in it, how its output is looked at, and how exactly.
LINKS: Mapping[str, tuple[str, str, Callable[[int], Callable[[], float]], float]] = {
    "Modbus TCP": ("hpv41-modbus-tcp", r'address = "127\.0\.0\.1:(\d+)"', observer.modbus_tcp, 0.6),
    "Modbus RTU": ("hpv41-modbus-rtu", r'address = "socket://127\.0\.0\.1:(\d+)"', observer.modbus_rtu, 0.6),
    "serial": ("hpv41-serial", r'address = "socket://127\.0\.0\.1:(\d+)"', observer.ascii_module, 0.6),
    "CANopen": ("hpv41-canopen", r'address = "socketcand:127\.0\.0\.1:(\d+)"', observer.canopen, 2.0),
}
WATCHDOG_S = 10.0
_DEAD_S = 3.0  # the link, counted from the end of the program
_ALIVE = ["levels=40", "hold_s=120"]


@dataclass
class Running:
    """A run in a process of its own, on its own terminal where it has one."""

    process: subprocess.Popen[bytes]
    folder: Path
    said: Path
    terminal: int | None = None
    shown: list[bytes] = field(default_factory=list)

    @property
    def text(self) -> str:
        """What it has said, as far as anybody could hear it."""
        heard = b"".join(self.shown) if self.terminal is not None else self.said.read_bytes()
        return " ".join(line for line in heard.decode(errors="replace").splitlines() if line.startswith("hil"))


def _signals(run: Running) -> None:
    for number in (signal.SIGINT, signal.SIGINT, signal.SIGTERM):
        time.sleep(0.4)
        with suppress(ProcessLookupError):
            run.process.send_signal(number)


def _full_disk(run: Running) -> None:
    size = (run.folder / "samples.f8").stat().st_size + 2000
    resource.prlimit(run.process.pid, resource.RLIMIT_FSIZE, (size, size))


def _folder_gone(run: Running) -> None:
    shutil.rmtree(run.folder)


def _no_handles(run: Running) -> None:
    resource.prlimit(run.process.pid, resource.RLIMIT_NOFILE, (3, 3))


def _killed(run: Running) -> None:
    run.process.kill()


def _terminal_gone(run: Running) -> None:
    assert run.terminal is not None
    os.close(run.terminal)


SECOND: Mapping[str, Callable[[Running], None]] = {
    "Ctrl-C twice, then SIGTERM": _signals,
    "disk full": _full_disk,
    "run folder deleted": _folder_gone,
    "no file handles": _no_handles,
    "killed, as when memory runs out": _killed,
    "terminal closed": _terminal_gone,
}


@dataclass(frozen=True)
class Row:
    """What came of it."""

    link: str
    second: str
    status: int | None
    at_the_end: float | None
    after_healing: float | None
    safe_after_s: float | None
    said: str
    recorded: str
    watchdog: Mapping[str, Any]

    @property
    def lies(self) -> list[str]:
        """Where the program, its exit status or its record says otherwise than what stood at the device."""
        found: list[str] = []
        stood = self.at_the_end is None or abs(self.at_the_end) > 2.0
        if stood and self.status not in (3, -signal.SIGKILL):
            found.append(f"exit status {self.status}")
        if stood and ("outputs are safe" in self.said or self.recorded == "safe"):
            found.append("said to be safe")
        if self.safe_after_s is None:
            found.append("never made safe")
        if self.safe_after_s is not None and not {"safe_after_s"} & set(self.watchdog):
            found.append(f"the watchdog tells {dict(self.watchdog)}")
        return found


def measure(link: str, second: str, folder: Path) -> Row:
    """Make it happen."""
    bench, address, look, tolerance = LINKS[link]
    text = bench_text(bench, ("block_s = 0.1\n", f"block_s = 0.1\nwatchdog_s = {WATCHDOG_S}\n"))
    if link != "CANopen":  # whose heartbeat cannot be left out
        text = text.replace("\nwatchdog_s = 1.0\n", "\n", 1)
    for old, new in (('"/tmp/hil-modbus-rtu"', '"socket://127.0.0.1:1"'), *SELDOM):
        text = text.replace(old, new)
    served = folder / "served.toml"
    served.write_text(moved(text, folder), encoding="utf-8")
    with ExitStack() as stack:
        stack.enter_context(devices_of(served))
        found = re.search(address, served.read_text(encoding="utf-8"))
        assert found is not None
        line = observer.Line(int(found[1]))
        stack.callback(line.close)
        driven = folder / "driven.toml"
        driven.write_text(served.read_text(encoding="utf-8").replace(f":{found[1]}", f":{line.port}"), encoding="utf-8")
        watch = observer.Watch(look(int(found[1])), tolerance)
        stack.callback(watch.close)
        run = _start(driven, folder, SECOND[second] is _terminal_gone)
        stack.callback(run.process.kill)
        watch.wait(lambda: (watch.now or 0.0) > 30.0 or run.process.poll() is not None, PATIENCE_S)
        assert (watch.now or 0.0) > 30.0, f"not driven: {run.text}"
        time.sleep(1.0)
        line.dead = True
        SECOND[second](run)
        run.process.wait(PATIENCE_S)
        at_the_end = watch.now
        time.sleep(_DEAD_S)
        line.dead, healed_s = False, time.monotonic()
        safe = watch.wait(lambda: watch.is_safe and time.monotonic() - watch.unsafe_s > 0.5, PATIENCE_S)
        watchdog = _watchdog(run.folder, folder / "state")
        time.sleep(0.2)
        return Row(
            link, second, run.process.returncode, at_the_end, watch.now,
            max(0.0, watch.unsafe_s - healed_s) if safe else None, run.text, _recorded(run.folder), watchdog,
        )  # fmt: skip


def _start(bench: Path, folder: Path, on_a_terminal: bool) -> Running:
    command = [sys.executable, "-m", "hil", "run", "tiny_step", "--bench", str(bench), "--out", str(folder / "run")]
    command += [part for setting in _ALIVE for part in ("--set", setting)]
    environment = {**os.environ, "PYTHONPATH": str(STRANGER), "HIL_STATE_DIR": str(folder / "state")}
    said = folder / "said"
    if not on_a_terminal:
        with said.open("wb") as err:
            return Running(
                subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=err), folder / "run", said
            )
    near, far = os.openpty()

    def take_terminal() -> None:
        os.setsid()
        fcntl.ioctl(0, termios.TIOCSCTTY, 0)

    process = subprocess.Popen(command, env=environment, stdin=far, stdout=far, stderr=far, preexec_fn=take_terminal)
    os.close(far)
    run = Running(process, folder / "run", said, near)
    threading.Thread(target=_show, args=(run,), daemon=True).start()
    return run


def _show(run: Running) -> None:
    with suppress(OSError):
        while shown := os.read(run.terminal or 0, 4096):
            run.shown.append(shown)


def _recorded(folder: Path) -> str:
    """The state of the command as the run wrote it down; empty when it wrote nothing."""
    try:
        return str(json.loads((folder / "end.json").read_text())["meta"]["outputs"]["command"]["state"])
    except (OSError, KeyError):
        return ""


def _watchdog(folder: Path, state: Path) -> Mapping[str, Any]:
    """What the watchdog wrote down, in the run folder or, where that is gone, in the state folder."""
    deadline_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline_s:
        for path in (folder / "watchdog.json", *state.glob("watchdog/*.json")):
            with suppress(OSError, ValueError):
                told: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
                return told
        time.sleep(0.05)
    return {}


def main() -> int:
    """Measure every combination and print the table; the number of rows in which something is said that is not so."""
    wrong = 0
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as for what a shell runs in the background; it is inherited
        signal.signal(signal.SIGINT, signal.default_int_handler)
    print("| link | then | exit status | output at the end [%] | safe after healing [s] | recorded | so |")
    print("|---|---|---|---|---|---|---|", flush=True)
    for second in SECOND:
        for link in LINKS:
            with tempfile.TemporaryDirectory() as name:
                row = measure(link, second, Path(name))
            wrong += bool(row.lies)
            after = "never" if row.safe_after_s is None else f"{row.safe_after_s:.2f}"
            stood = "?" if row.at_the_end is None else f"{row.at_the_end:.1f}"
            print(f"| {link} | {second} | {row.status} | {stood} | {after} | {row.recorded or '–'} | "
                  f"{'; '.join(row.lies) or 'yes'} |", flush=True)  # fmt: skip
    return wrong


if __name__ == "__main__":
    sys.exit(1 if main() else 0)
