"""Benches of one described device: text of bench files, and a device that has everything a description can say."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.bench.fault import BenchError
from hil.bench.read import read_bench
from hil.bench.twin import subject
from hil.daq.conformance import CHECKS, examine, verdict_of
from hil.description.read import read_description

BENCH = """\
name = "described"
sample_rate_hz = 20
{devices}
[valve]
name = "a valve"
plant = "brevini-hpv41"
settling_s = 0.1

{channels}
[interlocks.alive]
channel = "{response}"
stale_s = 5.0
action = "stop"

[simulation]
seed = 1
"""
EVERYTHING = """\
protocol = "modbus"
summary = "everything that a description of Modbus can say"

[modbus]
addresses = "40001"
byte_order = "CDAB"
longest_read = 8
longest_write = 4
gap = 2

[terminals.command]
direction = "out"
unit = "V"
range = [-10.0, 10.0]
address = 40101
type = "s32"
raw = [-100000, 100000]
read_back = 30201
close = 0.001

[terminals.lamp]
direction = "out"
range = [0, 1]
address = 40120
bit = 5
kind = "digital"

[terminals.level]
direction = "out"
unit = "V"
range = [0.0, 10.0]
address = 40120
bits = [8, 15]
raw = [0, 250]

[terminals.relay]
direction = "out"
range = [0, 1]
address = 17
write = 15

[terminals."volts {n}"]
count = 3
first = 1
direction = "in"
unit = "V"
range = [-10.0, 10.0]
address = 30001
step = 2
type = "s16"
byte_order = "BA"
slope = 0.001
invalid = { "0x8000" = "sensor broken" }

[terminals.spool]
direction = "in"
unit = "V"
range = [-10.0, 10.0]
address = 30021
type = "f64"
byte_order = "BADC"
status = [{ address = 30030, bit = 3, means = "open wire" }]

[terminals.end]
direction = "in"
range = [0, 1]
address = 10004

[watchdog]
arm = [
  { address = 40302, value = "{safe:command}" },
  { address = 40304, value = "{safe:level}" },
  { address = 40301, value = "{ms}" },
]

[enable]
write = [{ address = 40310, value = 6 }, { address = 40310, value = 15 }]
ready = { address = 40311, mask = 0x000F, equals = 7, means = "operation enabled" }
disable = [{ address = 40310, value = 0 }]

[faults]
flags = [{ address = 40311, bit = 7, means = "over-temperature" }]
clear = [{ address = 40312, value = 1 }]
"""


def bench(device: str, channels: str, response: str) -> str:
    """A bench file of one device."""
    return BENCH.format(devices=f"\n[devices.io]\n{device}\n", channels=channels, response=response)


def output(name: str, terminal: str, unit: str = "V", role: str = "other", low: float = -10, high: float = 10) -> str:
    """A channel that is driven."""
    carries = "command" if role == "command" else ""
    scale = 'unit = "%"\nslope = 10.0\n' if carries else ""
    signal = f'\n[simulation.instruments."{name}"]\nsignal = "{carries}"\n{scale}'
    limits = f"limits = {{ low = {low}, high = {high} }}\n" if unit != "1" else ""
    return (
        f'[channels."{name}"]\nrole = "{role}"\ndevice = "io"\nterminal = "{terminal}"\nunit = "{unit}"\nsafe = 0.0\n'
        f"{limits}\n{signal}"
    )


def input_(name: str, terminal: str, unit: str = "V", role: str = "other", stands: float | None = None) -> str:
    """A channel that is read; what it measures is the command of the valve, or a value that stands still."""
    reads = 'signal = "command"\nunit = "%"\nslope = 10.0' if stands is None else f"value = {stands}"
    return (
        f'[channels."{name}"]\nrole = "{role}"\ndevice = "io"\nterminal = "{terminal}"\nunit = "{unit}"\n'
        f'\n[simulation.instruments."{name}"]\n{reads}\n'
    )


def written(folder: Path, name: str, text: str) -> Path:
    """A file of that name in the folder."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def is_told(folder: Path, text: str, old: str, new: str, told: str, line: int = 0) -> None:
    """A description with one thing instead of another is refused so, and with its line where one is given."""
    assert old in text
    path = written(folder, "device.toml", text.replace(old, new, 1))
    with pytest.raises(BenchError) as error:
        read_description(path)
    place = f"{path}:{line}: " if line else ""
    assert any(place in fault and told in fault for fault in error.value.faults), error.value.faults


def passes(path: Path, driver: str) -> set[str]:
    """The checks that the first device of a bench with this driver passes on its twin; it breaks none."""
    with subject(read_bench(path), path.parent, driver) as examined:
        results = list(examine(examined))
        broken = [result.check for result in results if result.verdict == "broken"]
        again = {check: verdict_of(CHECKS[check], examined) for check in broken}  # a busy computer is late now and then
    assert {check: text for check, (verdict, text) in again.items() if verdict == "broken"} == {}
    return {result.check for result in results if result.verdict == "passed"} | set(again)
