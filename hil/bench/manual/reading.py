"""What one input reads now, and in words whether that can be believed."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from hil.bench.file import ChannelEntry
from hil.bench.protection_coverage.channels import has_live_zero, zero_of
from hil.bench.read import BenchFile
from hil.daq.channel import InputChannel, Terminal
from hil.daq.scaled import measured
from hil.language.note import Note
from hil.record.recording import Array

_OPEN = 0.9  # of a live zero, as NAMUR NE 43 has it: 3.6 of 4 mA
_NOISE_S = 1.0  # over so long the noise is told
_UNCHANGED_S = 5.0  # so long without any change is told, where no interlock says how long is too long


@dataclass(frozen=True, slots=True)
class Reading:
    """An input as it was read last.

    Attributes:
        name, unit, raw_unit: of the channel, and of its terminal.
        raw, value: NaN where there is no measurement, infinite beyond the range; None before the first sample.
        noise: standard deviation over the last second, in `unit`; None where fewer than three samples say nothing.
        age_s: since it was read.
        state: `ok`, or what is wrong, in words.
    """

    name: str
    raw: float | None
    raw_unit: str
    value: float | None
    unit: str
    noise: float | None
    age_s: float
    state: str

    @property
    def is_stale(self) -> bool:
        """Whether nothing new comes any more."""
        return self.state.startswith("stale")


class Followed:
    """One input, sample after sample.

    Args:
        name: of the channel.
        file: the bench.
    """

    def __init__(self, name: str, file: BenchFile) -> None:
        self.name = name
        self.entry: ChannelEntry = file.bench.channels[name]
        self.terminal: Terminal = file.terminal_of(self.entry)
        stale = [i.stale_s for i in file.bench.interlocks.values() if i.channel == name and i.stale_s is not None]
        self._longest_s = min(stale, default=_UNCHANGED_S)
        self._samples: deque[tuple[float, float]] = deque()
        self._changed_s = -math.inf
        self._why = ""

    def take(self, time_s: Array, raw: Array, why: str = "") -> None:
        """Samples that came: their stamps, what the terminal read, shape (n,), and why some are no measurement."""
        self._why = why
        for at_s, value in zip(time_s.tolist(), raw.tolist(), strict=True):
            if not self._samples or not _is_same_reading(value, self._samples[-1][1]):
                self._changed_s = at_s
            self._samples.append((at_s, value))
        while self._samples and self._samples[0][0] < self._samples[-1][0] - _NOISE_S:
            self._samples.popleft()

    def forget(self) -> None:
        """Count what was taken until now no more to the last second."""
        self._samples.clear()

    def reading(self, age_s: float, silent: str = "") -> Reading:
        """How it stands.

        Args:
            age_s: since the last samples came.
            silent: why none come any more, in words; empty while they come.
        """
        if not self._samples:
            missing = Note("no measurement: {why}", why=silent or Note("no sample yet"))
            return Reading(self.name, None, self._raw_unit, None, self.entry.unit, None, age_s, missing)
        raw = self._samples[-1][1]
        marked = float(self._marked([raw])[0])
        return Reading(
            self.name, raw, self._raw_unit, float(self.entry.line.value_at(marked)), self.entry.unit, self.noise, age_s,
            Note("stale: {why}", why=silent) if silent else self._state(raw, marked),
        )  # fmt: skip

    @property
    def noise(self) -> float | None:
        """Standard deviation of the last second, in the channel's unit."""
        values = self._marked([value for _, value in self._samples])
        if len(values) < 3 or not np.isfinite(values).all():
            return None
        return float(abs(self.entry.line.slope) * np.std(values, ddof=1))

    @property
    def raw(self) -> Array:
        """What the terminal read in the last second, shape (n,)."""
        return np.array([value for _, value in self._samples])

    @property
    def resolution(self) -> float | None:
        """The smallest step between two readings of the last second, in the channel's unit; None where all are one."""
        steps = np.diff(np.unique([value for _, value in self._samples if math.isfinite(value)]))
        return float(abs(self.entry.line.slope) * steps.min()) if len(steps) else None

    def _state(self, raw: float, marked: float) -> str:
        if math.isnan(raw):
            return Note("no measurement: {why}", why=self._why) if self._why else Note("no measurement")
        if raw < self._open_below:
            return Note("open wire: below {level:.3g} {unit}", level=self._open_below, unit=self._raw_unit)
        if math.isinf(marked):
            return Note("over-range: at the upper end") if marked > 0.0 else Note("over-range: at the lower end")
        unchanged_s = self._samples[-1][0] - self._changed_s
        if self.terminal.kind != "digital" and unchanged_s >= self._longest_s:
            return Note("frozen: unchanged for {time_s:.1f} s", time_s=unchanged_s)
        return "ok"

    @property
    def _open_below(self) -> float:
        """Under which a broken wire reads, in the terminal's unit; a zero that is not live has no such place."""
        low, _ = self._range
        if self.terminal.kind == "current" and low > 0.0:
            return _OPEN * low
        return _OPEN * zero_of(self.entry) if has_live_zero(self.entry, self.terminal) else -math.inf

    def _marked(self, raw: Iterable[float]) -> Array:
        low, high = self._range
        channel = InputChannel(
            self.name, self.entry.terminal, self.terminal.kind, self._raw_unit, low, high, self.terminal.over
        )
        return measured(np.array(list(raw), dtype=np.float64), channel)

    @property
    def _range(self) -> tuple[float, float]:
        return self.entry.raw_range(self.terminal)

    @property
    def _raw_unit(self) -> str:
        return self.terminal.unit


def _is_same_reading(one: float, other: float) -> bool:
    return one == other or (math.isnan(one) and math.isnan(other))
