"""How often stated intervals hold a truth."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from hil.record.measurement import COVERAGE_FACTOR, Measured

Truth = float | tuple[float, float]
"""A value, or the two ends between which every value is true."""


@dataclass
class Tally:
    """What was said about one figure over the seeds, and what is true of it."""

    truth: Truth
    whole: bool = True
    unit: str = ""
    factor: float = COVERAGE_FACTOR
    values: list[float] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    stds: list[float] = field(default_factory=list)
    held: int = 0
    bounds: int = 0
    bounds_held: int = 0
    untold: int = 0
    unknown: int = 0

    def add(self, found: Measured) -> None:
        """One run's statement."""
        std = found.std if self.whole else found.repeatability
        if found.value is None:
            self.untold += 1
        elif found.relation != "=":
            self._bound(found)
        elif std is None or not math.isfinite(std):
            self.unknown += 1
        else:
            off = error(found.value, self.truth)
            self.values.append(found.value)
            self.errors.append(off)
            self.stds.append(std)
            self.held += abs(off) <= self.factor * std * (1.0 + 1e-9)

    def _bound(self, found: Measured) -> None:
        assert found.value is not None
        self.bounds += 1
        low, high = ends(self.truth)
        limit = self.factor * (found.std or 0.0)
        self.bounds_held += low <= found.value + limit if found.relation == "<" else high >= found.value - limit

    @property
    def beside(self) -> tuple[float, float]:
        """Shares of all runs that lie wholly below and wholly above the truth: wrong verdicts of a limit that is there.

        Values that are not told, and bounds that hold, judge nothing wrongly.
        """
        runs = self.stated + self.bounds + self.untold + self.unknown
        stated = zip(self.errors, self.stds, strict=True)
        below = sum(error < -self.factor * std * (1.0 + 1e-9) for error, std in stated)
        return below / max(runs, 1), (self.stated - self.held - below) / max(runs, 1)

    @property
    def stated(self) -> int:
        """Runs that gave a value with an uncertainty."""
        return len(self.values)


def ends(truth: Truth) -> tuple[float, float]:
    """Lowest and highest true value."""
    return truth if isinstance(truth, tuple) else (truth, truth)


def error(value: float, truth: Truth) -> float:
    """How far a value lies from the nearest true one."""
    low, high = ends(truth)
    return min(value - low, 0.0) + max(value - high, 0.0)
