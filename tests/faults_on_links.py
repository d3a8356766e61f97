"""Faults on real links: simulated devices on their own protocols, the program in this process or in one of its own."""

from __future__ import annotations

import json
import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from subprocess import Popen
from typing import Any
from unittest.mock import patch

import numpy as np

from hil.bench.read import BenchFile
from hil.errors import HilError, exit_status_of, with_notes
from sim_devices._quirks import Quirks
from tests.faults import Case, Observer, Seen, observed, samples_in, start_run, watchdog_of
from tests.links import opened, served
from tests.waits import PATIENCE_S

# By link: the bench, and the device on it that has the output.
LINKS = {"Modbus TCP": ("hpv41-modbus-tcp", "io"), "Modbus RTU": ("hpv41-modbus-rtu", "io"),
         "serial": ("hpv41-serial", "module"), "CANopen": ("hpv41-canopen", "valve")}  # fmt: skip
DRIVEN = "while it is driven"
_REACTION_S = 2.5  # time-outs of 0.2 s, blocks of 0.1 s, the devices' own watchdogs of 1 s, and a computer that is busy
WATCHDOG_S = 1.0  # of the watchdog process
_FOLLOWS = """block_s = 0.1
watchdog_s = 0

[interlocks.not-obeyed]
channel = "spool position"
minus = "command"
low = -25.0
high = 25.0
for_s = 0.3
action = "trip"
"""


def _misbehave(**quirks: Any) -> Callable[[Any], None]:
    def fault(device: Any) -> None:
        device.behaviour.quirks = Quirks(**quirks)

    return fault


def _pull_cable(device: Any) -> None:
    """Nothing reaches the device any more; it goes on by itself."""
    if hasattr(device, "node"):
        device.node.on_frame = lambda *_: ()
    else:
        device.device.answer = lambda _request: b""


def _freeze(device: Any) -> None:
    """The device says yes to everything, and its output stands still."""
    device.side.drive = lambda _values: None


def _second_master(device: Any) -> None:
    """Another program writes 8 V to the first register, again and again for 3 s."""
    with socket.create_connection((device.host, device.port), timeout=2.0) as line:
        for _ in range(300):
            line.sendall(bytes.fromhex("0001 0000 0006 01 06 0000 6666"))
            line.recv(64)
            time.sleep(0.01)


_OF_DEVICES: Mapping[str, tuple[Callable[[Any], None], float | None, str]] = {
    "no answers any more": (_misbehave(silent=True), _REACTION_S, ""),
    "one answer late by 0.4 s": (_misbehave(late_s=0.4, answers=1), _REACTION_S, ""),
    "one answer lost": (_misbehave(silent=True, answers=1), _REACTION_S, ""),
    "every answer garbled": (_misbehave(garbled=True), _REACTION_S, ""),
    "cable pulled within an answer": (_misbehave(cut=True), _REACTION_S, ""),
    "cable pulled": (_pull_cable, _REACTION_S, ""),
    "device restarts": (_misbehave(reboot=True, answers=1), _REACTION_S, ""),
    "device freezes its output": (_freeze, None, ""),
}
_OF_PROGRAMS: Mapping[str, tuple[Callable[[int], None], float, str]] = {
    "SIGKILL of the program": (lambda pid: os.kill(pid, signal.SIGKILL), _REACTION_S, "outputs made safe in"),
    "program hangs (SIGSTOP)": (lambda pid: os.kill(pid, signal.SIGSTOP), WATCHDOG_S + _REACTION_S, "and was killed"),
    "SIGKILL of the watchdog": (lambda pid: os.kill(watchdog_of(pid), signal.SIGKILL), _REACTION_S,
                                "the watchdog process ended: killed by SIGKILL; the run was stopped"),
    "SIGTERM": (lambda pid: os.kill(pid, signal.SIGTERM), _REACTION_S, "stopped; outputs are safe"),
    "SIGHUP, a closed terminal": (lambda pid: os.kill(pid, signal.SIGHUP), _REACTION_S, "stopped; outputs are safe"),
    "Ctrl-C": (lambda pid: os.kill(pid, signal.SIGINT), _REACTION_S, "stopped; outputs are safe"),
}  # fmt: skip

CASES = [
    *(Case(link, fault, DRIVEN, within_s, says)
      for link in LINKS for fault, (_, within_s, says) in (*_OF_DEVICES.items(), *_OF_PROGRAMS.items())),
    Case("Modbus TCP", "second master", DRIVEN, 3.0 + _REACTION_S, ""),
]  # fmt: skip


def measure(case: Case, folder: Path, answers: tuple[tuple[str, str], ...] = ()) -> Seen:
    """Make it happen; links wait as long as their drivers do by themselves, or for `answers`."""
    with patch.dict(os.environ, HIL_STATE_DIR=str(folder / "state")):  # a trip of one case is not for the next one
        how = _of_a_program if case.fault in _OF_PROGRAMS else _of_a_device
        return how(case, folder, answers)


def _of_a_device(case: Case, folder: Path, answers: tuple[tuple[str, str], ...]) -> Seen:
    fault = _second_master if case.fault == "second master" else _OF_DEVICES[case.fault][0]
    bench, name = LINKS[case.link]
    follows = ("block_s = 0.1\n", _FOLLOWS)
    with served(bench, folder, follows, answers=answers) as (file, devices), observed(devices) as observer:
        happened: list[float] = []

        def happen() -> None:
            happened.append(time.monotonic())
            fault(devices[name])

        message, status = _driven(file, folder / "run", observer, happen)
        assert happened, f"the run ended before the fault was made (status {status}): {message}"
        after_s = observer.safe_after(happened[0], 1.0 if case.within_s is None else PATIENCE_S)
    return Seen(after_s, None, message, samples_in(folder / "run"), status)


def _driven(file: BenchFile, run: Path, observer: Observer, happen: Callable[[], None]) -> tuple[str, int]:
    """A sine of 40 ± 30 % at 1 Hz; something happens meanwhile. What the program says when it ends, and its status."""
    timer = threading.Thread(target=_after_a_while, args=(observer, happen), daemon=True)
    try:
        with opened(file, run) as rig:
            timer.start()
            for _ in range(20):
                time_s = np.arange(round(rig.rate_hz)) / rig.rate_hz
                rig.play(40.0 + 30.0 * np.sin(2.0 * np.pi * time_s))
    except HilError as error:
        return f"{type(error).__name__}: {with_notes(error)}", exit_status_of(error)
    finally:
        if timer.is_alive():
            timer.join(PATIENCE_S)
    return "", 0


def _after_a_while(observer: Observer, happen: Callable[[], None]) -> None:
    observer.wait_until_driven()
    time.sleep(0.6)
    happen()


def _of_a_program(case: Case, folder: Path, answers: tuple[tuple[str, str], ...]) -> Seen:
    """The run is a process of its own; devices that allow it have no watchdog, so that only ours can act."""
    bench, _ = LINKS[case.link]
    own = [("watchdog_s = 1.0\n", "")] if case.link != "CANopen" else []
    watched = ("block_s = 0.1\n", f"block_s = 0.1\nwatchdog_s = {WATCHDOG_S}\n")
    with ExitStack() as stack:
        file, devices = stack.enter_context(served(bench, folder, *own, watched, answers=answers))
        observer = stack.enter_context(observed(devices))
        process: Popen[str] = stack.enter_context(start_run(file.path, folder / "run", folder / "state"))
        stack.callback(process.kill)
        observer.wait_until_driven(process)
        time.sleep(0.5)
        at_s = time.monotonic()
        _OF_PROGRAMS[case.fault][0](process.pid)
        after_s = observer.safe_after(at_s, PATIENCE_S)
        _, err = process.communicate(timeout=PATIENCE_S)
        of_the_watchdog = _of_the_watchdog(folder / "run", process)
    lines = [*(line for line in err.splitlines() if line.startswith("hil")), *of_the_watchdog]
    return Seen(after_s, None, " ".join(lines), samples_in(folder / "run"), process.returncode)


def _of_the_watchdog(run: Path, process: Popen[str]) -> list[str]:
    """What it wrote down, where the program could not say anything any more: nobody waits for its words on a pipe."""
    if process.returncode != -signal.SIGKILL:
        return []
    report = run / "watchdog.json"
    deadline_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline_s:
        with suppress(OSError, ValueError):
            with_notes = json.loads(report.read_text(encoding="utf-8"))
            return [f"{report}: {with_notes['why']}; outputs made safe in {with_notes['safe_after_s']:g} s"]
        time.sleep(0.02)
    return []
