"""From what a channel reads or drives to engineering units, and back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

from hil.record.recording import Array

_Number = TypeVar("_Number", float, Array)


class Scale:
    """A straight line: value = slope · raw + offset, of a number or of an array of them. The slope is not zero."""

    __slots__ = ()
    slope: float
    offset: float

    def value_at(self, raw: _Number) -> _Number:
        """What raw readings say."""
        return self.slope * raw + self.offset

    def raw_at(self, value: _Number) -> _Number:
        """What values need."""
        return (value - self.offset) / self.slope


@dataclass(frozen=True, slots=True)
class Calibration(Scale):
    """A straight line from raw (V, A, counts) at the terminal to engineering units.

    Attributes:
        unit: of the value.
        slope, offset: `unit` per raw unit, and `unit`.
        uncertainty: expanded uncertainty (k = 2) of the value, in `unit`; None when nobody stated one.
        date: ISO 8601 day of the calibration; `due` the day until which it holds; `source` the certificate.
        lag_s: the instrument's own time constant, where it is known.
    """

    unit: str
    slope: float = 1.0
    offset: float = 0.0
    uncertainty: float | None = None
    date: str = ""
    due: str = ""
    source: str = ""
    lag_s: float | None = None

    def range_of(self, low: float, high: float) -> tuple[float, float]:
        """The engineering range of a raw range, lower end first whatever the slope's sign."""
        ends = self.value_at(low), self.value_at(high)
        return min(ends), max(ends)
