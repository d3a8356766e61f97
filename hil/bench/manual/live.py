"""What a bench can measure: each link's delay and rate, each input's noise and resolution, looked at live."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hil.bench.file import Bench
from hil.bench.manual.inputs import Inputs, inputs_of
from hil.bench.manual.reading import Reading
from hil.bench.protection import interlock_of
from hil.bench.read import BenchFile
from hil.daq.contract import Promises
from hil.errors import LinkError
from hil.record.recording import Array
from hil.safety.standstill import NEVER, most_by_chance
from hil.signals.stepped_sine import SAMPLES_PER_PERIOD

_LOOK_S = 0.5
_SHARE = 0.8  # of the time that a polled link has, it is used


@dataclass(frozen=True, slots=True)
class Link:
    """A device, its inputs read.

    Attributes:
        name: of the device.
        timing: who times the samples.
        latency_s: how long reading all inputs takes; None where the device times samples.
        rate_hz: how often its inputs can be read.
        sample_s: how long a sample of a run takes on it, driving counted like reading; 0 where the device times.
    """

    name: str
    timing: str
    latency_s: float | None
    rate_hz: float
    sample_s: float


@dataclass(frozen=True, slots=True)
class Seen:
    """An input as it was read for a while.

    Attributes:
        reading: the last one, with noise and state.
        resolution: the smallest step between two readings, in its unit; None where it did not change.
        remark: why the reading is not plausible on a bench at rest; empty when nothing speaks against it.
        is_watched: whether an interlock needs it.
        standstill_s: how long it stands until that interlock takes it for a device that repeats itself; None where its
            noise at rest cannot tell.
    """

    reading: Reading
    resolution: float | None
    remark: str
    is_watched: bool = False
    standstill_s: float | None = None


@dataclass(frozen=True, slots=True)
class Live:
    """What was seen of a bench.

    Attributes:
        links: by device, as far as they have inputs.
        inputs: every input.
        rate_hz: samples each second that the whole bench can make.
        unseen: devices with outputs alone, which were not opened and are not in the rate.
        silent: by device that does not answer, what it failed with; it is not in the rate either.
    """

    links: tuple[Link, ...]
    inputs: tuple[Seen, ...]
    rate_hz: float
    unseen: tuple[str, ...]
    silent: Mapping[str, str]

    @property
    def fastest_hz(self) -> float:
        """The highest −3 dB frequency that a frequency response can still measure at this rate."""
        return self.rate_hz / SAMPLES_PER_PERIOD

    @property
    def remarks(self) -> tuple[str, ...]:
        """Everything that is not plausible."""
        return tuple(f"'{seen.reading.name}': {seen.remark}" for seen in self.inputs if seen.remark)


def look_at(file: BenchFile, for_s: float = 3.0) -> Live:
    """Open every device with its inputs alone and read for a while; no output is opened.

    Raises:
        LinkError: no device answers.
        InUseError, SettingError: as `inputs_of`.
    """
    with inputs_of(file) as looked:
        readings = [looked.look(_LOOK_S) for _ in range(max(1, math.ceil(for_s / _LOOK_S)))][-1]
        silent = dict(looked.failures)
        if len(silent) == len(looked.devices):
            raise LinkError("; ".join(silent.values()))
        promised = {name: daq.promises for name, daq in looked.devices.items() if daq is not None}
        inputs = tuple(_seen(file.bench, reading, looked) for reading in readings)
    with_outputs = {channel.device for channel in file.bench.channels.values() if channel.is_output}
    links = tuple(_link(name, promises, name in with_outputs) for name, promises in promised.items())
    unseen = tuple(name for name in file.devices if name in with_outputs and name not in {*promised, *silent})
    return Live(links, inputs, _rate(promised, links), unseen, silent)


def _link(name: str, promises: Promises, drives: bool) -> Link:
    if promises.timing != "polled":
        return Link(name, promises.timing, promises.latency_s, promises.highest_rate_hz, 0.0)
    reading_s = max(_SHARE / promises.highest_rate_hz, promises.latency_s or 0.0)  # the first is that of the opening
    return Link(name, promises.timing, promises.latency_s, _SHARE / reading_s, (2.0 if drives else 1.0) * reading_s)


def _rate(promised: Mapping[str, Promises], links: tuple[Link, ...]) -> float:
    polled_s = sum(link.sample_s for link in links)
    timed_hz = min(
        (promises.highest_rate_hz for promises in promised.values() if promises.timing != "polled"), default=math.inf
    )
    return min(timed_hz, _SHARE / polled_s if polled_s else math.inf)


def _seen(bench: Bench, reading: Reading, looked: Inputs) -> Seen:
    remark = "" if reading.state == "ok" else reading.state
    followed = looked.followed[reading.name]
    is_watched = any(entry.channel == reading.name for entry in bench.interlocks.values())
    standstill_s = _standstill_s(followed.raw) if is_watched else None
    return Seen(reading, followed.resolution, remark or _forbidden(bench, reading), is_watched, standstill_s)


def _standstill_s(last_second: Array) -> float | None:
    """How long a reading of the middle may stand by chance."""
    if not len(last_second):
        return None
    most = most_by_chance(last_second, float(np.sort(last_second)[len(last_second) // 2]))
    return None if most == NEVER else most / len(last_second)


def _forbidden(bench: Bench, reading: Reading) -> str:
    """The interlock that would not let a run begin with this reading."""
    for name, entry in bench.interlocks.items():
        lock = interlock_of(name, entry, bench)
        simple = entry.channel == reading.name and not entry.minus and entry.only_while is None
        if simple and reading.value is not None and not lock.allowed.low <= reading.value <= lock.allowed.high:
            return (
                f"{reading.value:.4g} {reading.unit} is outside {lock.allowed.low:g} … {lock.allowed.high:g} "
                f"{reading.unit} of interlock '{name}'"
            )
    return ""
