"""Where an output may go, how fast, and how long it may stay: all arithmetic of limits is here."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from hil.arrays import ROUNDING
from hil.daq.check import within
from hil.errors import RangeError
from hil.record.recording import Array
from hil.safety.lasting import lasting_s


@dataclass(frozen=True, slots=True)
class Dwell:
    """An output may not stay beyond ±`level` for longer than `longest_s` without a break."""

    level: float
    longest_s: float


@dataclass(frozen=True, slots=True)
class Past:
    """What came before the samples under test: the last value, and how long each dwell level was exceeded."""

    value: float
    beyond_s: tuple[float | None, ...] = ()

    def held_for(self, duration_s: float) -> Past:
        """The same after the output has stood still for a while."""
        return replace(self, beyond_s=tuple(None if s is None else s + duration_s for s in self.beyond_s))


@dataclass(frozen=True, slots=True)
class Envelope:
    """Limits of one output, in its unit.

    Attributes:
        low, high: the allowed range.
        slew_per_s: the fastest change; a step from one sample to the next counts over one sample interval.
        dwells: how long it may stay beyond a level.
    """

    low: float
    high: float
    slew_per_s: float = math.inf
    dwells: tuple[Dwell, ...] = ()

    def tightened(self, other: Envelope) -> Envelope:
        """What both envelopes allow; never wider than either.

        Raises:
            RangeError: they have no value in common.
        """
        low, high = max(self.low, other.low), min(self.high, other.high)
        if low > high:
            raise RangeError(
                f"limits {other.low:g} … {other.high:g} leave nothing of the allowed {self.low:g} … {self.high:g}"
            )
        return Envelope(low, high, min(self.slew_per_s, other.slew_per_s), (*self.dwells, *other.dwells))

    def start(self, value: float) -> Past:
        """The past of an output that has just come to stand at `value`."""
        return Past(value, tuple(0.0 if abs(value) > dwell.level else None for dwell in self.dwells))

    def admit(self, values: Array, rate_hz: float, past: Past, *, name: str, unit: str) -> tuple[Array, Past]:
        """The samples, rounding trimmed off, and the past for those that follow.

        Args:
            values: the samples to be driven, shape (n,), n ≥ 1.
            rate_hz: their sample rate.
            past: what came before.
            name: of the output, for the message.
            unit: of the output, for the message.

        Raises:
            RangeError: a sample is not a number, out of range, changes too fast or stays too long; names the
                output, the sample, the value and what is allowed.
        """
        where = f"output '{name}'"
        values = within(values, self.low, self.high, name, unit)
        self._check_slew(values, rate_hz, past.value, where, unit)
        return values, Past(float(values[-1]), self._dwelt(values, rate_hz, past, where, unit))

    def _check_slew(self, values: Array, rate_hz: float, before: float, where: str, unit: str) -> None:
        if math.isinf(self.slew_per_s):
            return
        change = np.abs(np.diff(values, prepend=before))
        allowed = self.slew_per_s / rate_hz
        at = int(np.argmax(change))
        if change[at] > allowed * (1.0 + ROUNDING) + ROUNDING * (self.high - self.low):
            start = before if at == 0 else values[at - 1]
            raise RangeError(
                f"{where}, sample {at}: from {start:g} to {values[at]:g} {unit} in {1.0 / rate_hz:g} s is "
                f"{change[at] * rate_hz:g} {unit}/s; allowed {self.slew_per_s:g} {unit}/s"
            )

    def _dwelt(self, values: Array, rate_hz: float, past: Past, where: str, unit: str) -> tuple[float | None, ...]:
        if not self.dwells:
            return ()
        before = (*past.beyond_s, *self.start(past.value).beyond_s[len(past.beyond_s) :])  # dwells added since
        time_s = np.arange(len(values)) / rate_hz
        return tuple(
            _dwelt_beyond(dwell, values, time_s, 1.0 / rate_hz, beyond_s, where, unit)
            for dwell, beyond_s in zip(self.dwells, before, strict=True)
        )


def _dwelt_beyond(
    dwell: Dwell, values: Array, time_s: Array, interval_s: float, beyond_s: float | None, where: str, unit: str
) -> float | None:
    if -dwell.level <= values.min() and values.max() <= dwell.level:
        return None
    beyond = np.abs(values) > dwell.level
    held_s, since_s = lasting_s(beyond, time_s, None if beyond_s is None else -beyond_s)
    held_s += interval_s  # a sample stands until the next one
    too_long = beyond & (held_s > dwell.longest_s * (1.0 + ROUNDING))
    if too_long.any():
        at = int(np.argmax(too_long))
        raise RangeError(
            f"{where}, sample {at}: beyond ±{dwell.level:g} {unit} for {held_s[at]:g} s; allowed {dwell.longest_s:g} s"
        )
    return None if since_s is None else float(time_s[-1] + interval_s - since_s)
