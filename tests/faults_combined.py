"""A link falls dead while a valve is driven, and then a second thing goes wrong: what is said, and what stands.

python -m tests.faults_combined            prints the table
"""

from __future__ import annotations

import re
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests import observer
from tests.links import SELDOM, bench_text, devices_of, moved
from tests.outside.judge import Seen
from tests.outside.running import WATCHDOG_S, Program, run_command, started
from tests.outside.situations import (
    Act,
    Scene,
    disk_full,
    folder_gone,
    no_handles,
    signalled,
    terminal_closed,
)
from tests.waits import PATIENCE_S

# By link: the bench, the address of the device with the output in it, how its output is looked at, and how exactly.
LINKS: Mapping[str, tuple[str, str, Callable[[int], Callable[[], float]], float]] = {
    "Modbus TCP": ("hpv41-modbus-tcp", r'address = "127\.0\.0\.1:(\d+)"', observer.modbus_tcp, 0.6),
    "Modbus RTU": ("hpv41-modbus-rtu", r'address = "socket://127\.0\.0\.1:(\d+)"', observer.modbus_rtu, 0.6),
    "serial": ("hpv41-serial", r'address = "socket://127\.0\.0\.1:(\d+)"', observer.ascii_module, 0.6),
    "CANopen": ("hpv41-canopen", r'address = "socketcand:127\.0\.0\.1:(\d+)"', observer.canopen, 2.0),
}
_DEAD_S = 3.0  # the link, counted from the end of the program
SECOND: Mapping[str, Act] = {
    "Ctrl-C twice, then SIGTERM": signalled(signal.SIGINT, signal.SIGINT, signal.SIGTERM),
    "disk full": disk_full,
    "run folder deleted": folder_gone,
    "no file handles": no_handles,
    "killed, as when memory runs out": signalled(signal.SIGKILL),
    "terminal closed": terminal_closed,
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
        program = started(folder, run_command(driven, "level=40"), SECOND[second] is terminal_closed)
        stack.callback(program.end)
        watch.wait(lambda: (watch.now or 0.0) > 30.0 or program.process.poll() is not None, PATIENCE_S)
        assert (watch.now or 0.0) > 30.0, f"not driven: {program.said}"
        time.sleep(1.0)
        line.dead = True
        SECOND[second](Scene(None, program, Seen(second), None))  # type: ignore[arg-type]
        program.process.wait(PATIENCE_S)
        at_the_end = watch.now
        time.sleep(_DEAD_S)
        line.dead, healed_s = False, time.monotonic()
        safe = watch.wait(lambda: watch.is_safe and time.monotonic() - watch.unsafe_s > 0.5, PATIENCE_S)
        watch.wait(lambda: program.told("watchdog.json") is not None, PATIENCE_S)
        time.sleep(0.2)
        return Row(
            link, second, program.process.returncode, at_the_end, watch.now,
            max(0.0, watch.unsafe_s - healed_s) if safe else None, program.said, _recorded(program),
            program.told("watchdog.json") or {},
        )  # fmt: skip


def _recorded(program: Program) -> str:
    """The state of the command as the run wrote it down; empty when it wrote nothing."""
    meta = (program.told("end.json") or {}).get("meta", {})
    return str(meta.get("outputs", {}).get("command", {}).get("state", ""))


def main() -> int:
    """Measure every combination and print the table; the number of rows in which something is said that is not so."""
    wrong = 0
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
