"""The board of a bench: every channel as `hil watch` tells it, links, interlocks, and trips that are latched."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hil.bench.file import Bench
from hil.bench.manual.reading import Followed, Reading
from hil.bench.protection import envelopes_of, interlock_of
from hil.bench.read import BenchFile
from hil.daq.contract import Block
from hil.errors import UnknownNameError
from hil.language.figures import localised
from hil.language.note import Note, translated
from hil.language.words import _
from hil.record.recording import Recording
from hil.record.run_folder.tail import Tail
from hil.report.number import label_text, note_text, unit_text
from hil.safety.interlock import Interlock
from hil.safety.latch import Latch, latch_path

_KEPT_S = 1.5  # of a long piece only so much is looked at
STALE_S = 1.0  # a reading older than this is grey, and its number is told with its age alone


@dataclass(frozen=True, slots=True)
class Line:
    """A channel as the board shows it.

    Attributes:
        name, unit, source: of the channel; `is_output` whether it is driven.
        value, noise, age_s: None where there is none; a value that was not measured is none.
        limit: what it must keep to, in words; empty where nothing is asked.
        state: `ok`, or what is wrong, in words.
        tone: `good`, `bad`, `stale`, `missing`: how the page shows it, beside the words.
    """

    name: str
    unit: str
    source: str
    is_output: bool
    value: float | None
    noise: float | None
    age_s: float | None
    limit: str
    state: str
    tone: str


def lines_of(file: BenchFile, readings: Iterable[Reading], levels: Mapping[str, tuple[float, float]]) -> list[Line]:
    """Every channel of a bench, outputs first.

    Args:
        file: the bench.
        readings: of its inputs, as far as somebody reads them.
        levels: of outputs that a run drives, by name: what was driven last, and how long ago in s.
    """
    by_name = {reading.name: reading for reading in readings}
    limits = limits_of(file.bench)
    channels = sorted(file.bench.channels.items(), key=lambda item: not item[1].is_output)
    found = []
    for name, entry in channels:
        source = entry.source or f"{entry.device} {entry.terminal}"
        head = (name, unit_text(entry.unit), source)
        if entry.is_output:
            found.append(_output(head, levels.get(name), limits.get(name, "")))
        else:
            found.append(_input(head, by_name.get(name), limits.get(name, "")))
    return found


def _output(head: tuple[str, str, str], level: tuple[float, float] | None, limit: str) -> Line:
    if level is None:
        return Line(*head, True, None, None, None, limit, "not driven by a run", "missing")
    value, age_s = level
    stale = age_s > STALE_S
    return Line(*head, True, value, None, age_s, limit, "stale" if stale else "driven", "stale" if stale else "good")


def _input(head: tuple[str, str, str], reading: Reading | None, limit: str) -> Line:
    if reading is None:
        return Line(*head, False, None, None, None, limit, "not being read", "missing")
    value = reading.value if reading.value is not None and math.isfinite(reading.value) else None
    if reading.age_s > STALE_S and reading.state == "ok":
        reading = replace(reading, state=Note("stale: nothing new for {time_s:.1f} s", time_s=reading.age_s))
    is_ok = reading.state == "ok"
    tone = "good" if is_ok else "stale" if reading.is_stale else "missing" if value is None else "bad"
    return Line(*head, False, value, reading.noise, reading.age_s, limit, translated(reading.state), tone)


def limits_of(bench: Bench) -> dict[str, str]:
    """What each channel must keep to, in words: the envelope of an output, the interlocks of an input."""
    found: dict[str, list[str]] = {}
    for name, envelope in envelopes_of(bench).items():
        found.setdefault(name, []).append(label_text(f"{envelope.low:g} … {envelope.high:g}"))
    for name, entry in bench.interlocks.items():
        lock = interlock_of(name, entry, bench)
        if lock.allowed.asks and not entry.minus and entry.only_while is None:
            text = str(lock.allowed).removeprefix(lock.allowed.channel).strip().removeprefix("in ")
            found.setdefault(entry.channel, []).append(label_text(text))
    return {name: "; ".join(texts) for name, texts in found.items()}


def interlocks_of(file: BenchFile, lines: Sequence[Line]) -> list[dict[str, Any]]:
    """Every interlock: what it asks, what it does, and whether the last readings keep it."""
    values = {line.name: line.value for line in lines if line.value is not None and line.tone in ("good", "bad")}
    found = []
    for name, entry in file.bench.interlocks.items():
        lock = interlock_of(name, entry, file.bench)
        found.append({"name": name, "asks": _asks(lock), "action": lock.action, "state": _kept(lock, values)})
    return found


def _asks(lock: Interlock) -> str:
    asked = [note_text(lock.allowed.note)] if lock.allowed.asks else []
    if lock.stale_s is not None:
        within = localised(f"{lock.stale_s:g} s")
        asked.append(_("{channel} changes within {time}").format(channel=lock.allowed.channel, time=within))
    text = "; ".join(asked)
    if lock.only_while is not None:
        text = _("{asked}, while {condition}").format(asked=text, condition=note_text(lock.only_while.note))
    if lock.for_s:
        text = _("{asked}, for {time} at most").format(asked=text, time=localised(f"{lock.for_s:g} s"))
    return text


def _kept(lock: Interlock, values: Mapping[str, float]) -> str:
    """`kept`, `broken`, or `not known` as of one reading of each channel."""
    if not lock.allowed.asks:
        return "judged by the run"
    asked = [lock.allowed.channel, *filter(None, [lock.allowed.minus])]
    asked += [lock.only_while.channel] if lock.only_while else []
    if any(name not in values for name in asked):
        return "not known"
    block = Block(np.zeros(1), {name: np.array([values[name]]) for name in asked}, {})
    if lock.only_while is not None and not lock.only_while.may_hold(block)[0]:
        return "kept"
    return "broken" if lock.allowed.outside(block)[0] else "kept"


def trips_of(file: BenchFile) -> dict[str, str]:
    """What has tripped on this bench and was not reset, with the reason."""
    return {} if file.is_simulated else Latch(latch_path(file.bench.name)).trips


def check_tripped(file: BenchFile, name: str) -> None:
    """Raise `UnknownNameError` unless an interlock of that name has tripped here."""
    trips = trips_of(file)
    if name not in trips:
        raise UnknownNameError("tripped interlock", name, trips)


def reset_trip(file: BenchFile, name: str) -> None:
    """Forget a trip, by the name of its interlock.

    Raises:
        UnknownNameError: nothing of that name has tripped.
        StorageError: it cannot be kept.
    """
    Latch(latch_path(file.bench.name)).reset(name)


class RunReader:
    """The channels of a bench as a run records them, told like `hil watch` tells them.

    Args:
        file: the bench.
        folder: of the run.
    """

    def __init__(self, file: BenchFile, folder: Path) -> None:
        self._file = file
        self._tail = Tail(folder)
        self._followed = {n: Followed(n, file) for n, entry in file.bench.channels.items() if not entry.is_output}
        self._levels: dict[str, float] = {}
        self._came_s = -math.inf

    def read(self) -> tuple[list[Reading], dict[str, tuple[float, float]]]:
        """(readings of inputs, levels of outputs with their age). Raises `FileError` when the folder went away."""
        while len(new := self._tail.samples()):
            self._take_tail(new)
        age_s = time.monotonic() - self._came_s
        if not self._levels and not math.isfinite(self._came_s):
            return [], {}
        readings = [followed.reading(age_s) for followed in self._followed.values()]
        return readings, {name: (value, age_s) for name, value in self._levels.items()}

    def _take_tail(self, new: Recording) -> None:
        late = new.time_s >= new.time_s[-1] - _KEPT_S
        for name, channel in new.channels.items():
            if name in self._followed:
                raw = self._file.bench.channels[name].line.raw_at(channel.values[late])
                self._followed[name].take(new.time_s[late], raw)
            elif name in self._file.bench.channels:
                self._levels[name] = float(channel.values[-1])
        self._came_s = time.monotonic()
