"""From what a channel reads or drives to engineering units, and back."""

from __future__ import annotations

from dataclasses import dataclass

from hil.record.recording import Array


@dataclass(frozen=True, slots=True)
class Calibration:
    """A straight line from raw (V, A, counts) to engineering units: value = slope · raw + offset.

    Attributes:
        unit: of the value.
        slope, offset: `unit` per raw unit, and `unit`. The slope is not zero.
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

    def to_value(self, raw: Array) -> Array:
        """Raw readings in engineering units."""
        return self.slope * raw + self.offset

    def to_raw(self, value: Array) -> Array:
        """Engineering units as the output must be driven."""
        return (value - self.offset) / self.slope

    def value_at(self, raw: float) -> float:
        """One raw reading in engineering units."""
        return self.slope * raw + self.offset

    def raw_at(self, value: float) -> float:
        """What one value in engineering units needs at the terminal."""
        return (value - self.offset) / self.slope

    def range_of(self, low: float, high: float) -> tuple[float, float]:
        """The engineering range of a raw range, lower end first whatever the slope's sign."""
        ends = self.value_at(low), self.value_at(high)
        return min(ends), max(ends)
