"""Whatever a driver throws, whenever: what the program says of outputs is what stands at the devices.

The devices are looked at, not asked: the program knows nothing of them but what its links say.
"""

from __future__ import annotations

import os
import signal
import tempfile
from collections.abc import Callable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.bench.ending import accounted
from hil.bench.open import open_rig
from hil.bench.read import BenchFile, read_bench
from hil.clock import VirtualClock
from hil.daq.channel import Wiring
from hil.daq.link import Late
from hil.daq.polled import PolledDaq
from hil.errors import DeviceLostError, FileError, LinkError, exit_status_of, with_notes
from hil.record.run_folder.header import read_end
from hil.record.run_folder.samples import RowsWriter
from hil.safety.interrupt import terminable
from hil.safety.outputs import Outputs

BENCH = """\
name = "two devices"
sample_rate_hz = 100
[valve]
name = "none"
plant = "brevini-hpv41"
settling_s = 0.1
[devices.daq]
simulated = "in_process"
time = "virtual"
[channels.command]
role = "command"
device = "daq"
terminal = "ao0"
unit = "%"
calibration = { slope = 1.0 }
safe = 1.0
ramp_to_safe_per_s = 100.0
limits = { low = -10.0, high = 10.0 }
[channels.enable]
device = "daq"
terminal = "ao1"
unit = "V"
safe = 0.0
on = 5.0
limits = { low = 0.0, high = 10.0 }
[channels.flow]
role = "response"
device = "daq"
terminal = "ai0"
unit = "V"
[protection]
block_s = 0.1
[simulation.instruments]
command = { signal = "command" }
enable = { signal = "" }
flow = { value = 0.0 }
"""
LINKS = ("first", "second")
CALLS = ("standing", "drive", "read", "close")
SAFE = {"first": 1.0, "second": 0.0}
ERRORS: tuple[Callable[[], BaseException], ...] = (
    lambda: LinkError("no answer"), lambda: DeviceLostError("gone"), lambda: OSError(24, "too many open files"),
    lambda: MemoryError(), lambda: KeyError("ao0"), lambda: UnicodeDecodeError("ascii", b"\xff", 0, 1, "garbled"),
    lambda: SystemExit("of a library"), lambda: RecursionError(), lambda: StopIteration(), lambda: AssertionError(),
)  # fmt: skip
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)


@dataclass(frozen=True)
class Fault:
    """From one of its calls on, a link throws so many times, before or after the device has done what it was told."""

    link: str
    call: str
    at: int
    times: int
    error: int
    obeyed: bool


@dataclass
class Device:
    """An output and an input; what stands here is what is true."""

    name: str
    level: float
    faults: list[Fault]
    signals: dict[int, int]
    watchdog_s: float | None = None
    keep_alive_s: float | None = None
    clock: VirtualClock = field(default_factory=VirtualClock)
    calls: dict[str, int] = field(default_factory=lambda: dict.fromkeys(CALLS, 0))

    def standing(self) -> Mapping[str, float]:
        self._happen("standing")
        return {self.terminal: self.level}

    def drive(self, values: Mapping[str, float]) -> None:
        self._happen("drive", lambda: setattr(self, "level", values[self.terminal]))

    def read(self) -> Mapping[str, float]:
        self._happen("read")
        return {"ai0": self.level}

    def close(self) -> None:
        self._happen("close")

    @property
    def terminal(self) -> str:
        return {"first": "ao0", "second": "ao1"}[self.name]

    def _happen(self, call: str, act: Callable[[], None] = lambda: None) -> None:
        self.calls[call] += 1
        self.clock.sleep_until(self.clock.now_s + 1e-4)
        if (number := self.signals.pop(sum(self.calls.values()), None)) is not None:
            os.kill(os.getpid(), number)
        for fault in self.faults:
            if fault.call == call and fault.at <= self.calls[call] < fault.at + fault.times:
                if fault.obeyed:
                    act()
                raise ERRORS[fault.error]()
        act()


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    path = tmp_path_factory.mktemp("bench") / "bench.toml"
    path.write_text(BENCH, encoding="utf-8")
    return read_bench(path)


def bench_with(devices: list[Device], file: BenchFile) -> BenchFile:
    """The bench, whose devices are these. What was sent to them arrives late by no more than 20 ms."""

    def open_daq(_settings: Any, wiring: Wiring) -> PolledDaq:
        wirings = {
            device.name: Wiring({n: c for n, c in wiring.outputs.items() if c.terminal == device.terminal},
                                wiring.inputs if device.name == "first" else {})
            for device in devices
        }  # fmt: skip
        for device in devices:
            device.clock = clock
        late = {device.name: Late(0.02) for device in devices}
        return PolledDaq({device.name: device for device in devices}, wirings, clock, late=late)

    clock = VirtualClock()
    (real,) = file.devices.values()
    return replace(file, devices={real.name: replace(real, module=SimpleNamespace(open_daq=open_daq))})


@contextmanager
def disk_full_after(blocks: int | None):
    """No block but so many can be recorded."""
    append, written = RowsWriter.append, []

    def refuse(self: RowsWriter, table: np.ndarray) -> None:
        written.append(1)
        if blocks is not None and len(written) > blocks:
            raise OSError(28, "No space left on device")
        append(self, table)

    with patch.object(RowsWriter, "append", refuse):
        yield


@dataclass(frozen=True)
class Said:
    """What the program said at the end."""

    status: int
    text: str
    known: Outputs
    end: Mapping[str, Any] | None


def ended(devices: list[Device], blocks: int | None, bench: BenchFile) -> Said:
    """Drive up, stand, drive down, with everything that happens on the way; what was said."""
    known, status, text = Outputs(), 0, ""
    with tempfile.TemporaryDirectory() as name, disk_full_after(blocks):
        folder = Path(name)
        file = bench_with(devices, bench)
        try:
            with (
                accounted(known),
                terminable(),
                open_rig(file, folder / "run", {}, lambda *_: None, output_states=known) as rig,
            ):
                rig.play(np.linspace(1.0, 8.0, 20))
                for _ in rig.stream([np.full(10, 8.0), np.full(10, 6.0)]):
                    pass
        except BaseException as error:
            status, text = exit_status_of(error), with_notes(error)
        try:
            end = read_end(folder / "run")
        except FileError:
            end = None
        return Said(status, text, known, None if end is None else end.meta["outputs"])


def check(said: Said, devices: list[Device]) -> None:
    for device, name in zip(devices, ("command", "enable"), strict=True):
        stands_safe = abs(device.level - SAFE[device.name]) < 0.05
        if not said.known.by_name:  # never opened
            continue
        state = said.known.by_name[name].state
        assert stands_safe or state != "safe", (state, device.level, said.text)
        assert stands_safe or (said.status == 3 and "outputs are safe" not in said.text), said
        assert stands_safe or name in said.text, said
        if not device.faults:
            assert stands_safe and state == "safe", f"{device.name} was kept from its safe value: {said}"
        if said.end is not None:
            assert stands_safe or said.end[name]["state"] != "safe", said.end
        assert device.calls["close"], f"{device.name} was not let go of"
    if said.status != 3:
        assert said.known.settled or not said.known.by_name
    if said.status == 2:
        assert not said.known.moved


faults = st.builds(
    Fault, st.sampled_from(LINKS), st.sampled_from(CALLS), st.integers(1, 60), st.sampled_from([1, 2, 5, 10_000]),
    st.integers(0, len(ERRORS) - 1), st.booleans(),
)  # fmt: skip


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    """A device that never answers is waited for in wall-clock time: not for long here."""
    monkeypatch.setattr("hil.safety.outputs._PATIENCE_S", 0.02)
    monkeypatch.setattr("hil.daq.polled._PROBES", 3)


@settings(max_examples=80)
@given(
    thrown=st.lists(faults, max_size=3),
    signals=st.dictionaries(st.integers(1, 150), st.sampled_from(SIGNALS), max_size=3),
    blocks=st.one_of(st.none(), st.integers(0, 6)),
)
def test_what_is_said_of_outputs_is_so(bench, thrown, signals, blocks):
    devices = [
        Device(name, level, [f for f in thrown if f.link == name], signals if name == "first" else {})
        for name, level in (("first", 3.0), ("second", 2.0))
    ]
    check(ended(devices, blocks, bench), devices)
