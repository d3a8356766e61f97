"""A measured value, and what it says about a limit.

The rule of decision is the guard band of ISO 14253-1 (JCGM 106 calls it guarded acceptance, and guarded
rejection on the other side): a value is known only within its expanded uncertainty U = 2·u, so it passes when
value ± U lies wholly inside the limits, fails when value ± U lies wholly outside, and otherwise nobody can tell.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

from hil.record.plain import plain

Verdict = Literal["pass", "fail", "cannot tell"]
Relation = Literal["=", ">", "<"]
COVERAGE_FACTOR = 2.0
RENAMED = {"dead_time": "onset", "reaches": "band_entry"}
"""Quantities of earlier versions by their names of today: read wherever a name is read, never written."""


@dataclass(frozen=True, slots=True)
class Measured:
    """A measured quantity; `value` is None where it could not be determined, `verdict` where there is no limit.

    `std` is the whole standard uncertainty, None where none is known; `calibration_std` the part of it that all runs on
    one bench share. With `relation` `<` or `>` the value is a bound: the quantity lies below or above it.
    """

    __pydantic_config__: ClassVar = {"extra": "forbid"}
    name: str
    value: float | None
    unit: str
    std: float | None = None
    low: float | None = None
    high: float | None = None
    verdict: Verdict | None = None
    relation: Relation = "="
    meaning: str = ""
    calibration_std: float = 0.0

    @property
    def expanded(self) -> float | None:
        """Expanded uncertainty, as it is shown behind ±; None where it is not known."""
        return None if self.std is None else COVERAGE_FACTOR * self.std

    @property
    def limits(self) -> str:
        """Where it must lie, as `1.5 … 2`; empty where there is no limit."""
        edges = ("" if edge is None else f"{edge:g}" for edge in (self.low, self.high))
        return "" if self.low is None and self.high is None else " … ".join(edges)

    @property
    def is_known(self) -> bool:
        """Whether it is a number with its uncertainty, and no bound."""
        return self.relation == "=" and self.value is not None and self.std is not None

    @property
    def repeatability(self) -> float | None:
        """Standard uncertainty without the calibration: how a repeat on the same bench would scatter."""
        if self.std is None or not math.isfinite(self.std):
            return self.std
        return math.sqrt(max(self.std**2 - self.calibration_std**2, 0.0))

    @property
    def quantity(self) -> str:
        """The name under which it was declared, without the place."""
        return self.name.partition(", ")[0]

    @property
    def renamed(self) -> Measured:
        """The same by its name of today; for values that a file or an archive holds."""
        return replace(self, name=present_name(self.name))

    @property
    def names(self) -> tuple[str, ...]:
        """Under which it may be asked for: the whole name, then without the last parts of its place."""
        return names_of(self.name)

    @property
    def verdict_of_limits(self) -> Verdict | None:
        """Pass, fail or cannot tell by its own limits, however the run ended."""
        return judge(self.value, self.std, self.low, self.high, self.relation)

    def fail_probability(self, value: float, std: float) -> float | None:
        """How likely a unit would have been measured *fail* here: `value` with the scatter `std` of its measurement.

        Limits, uncertainty and rule of decision are those of this value. None where these do not make the verdict:
        it is a bound or a count, was not determined, its uncertainty is not known, or it has no limit.
        """
        if self.relation != "=" or not self.std or self.verdict is None:
            return None
        guard = COVERAGE_FACTOR * self.std
        low, high = (-math.inf if self.low is None else self.low), (math.inf if self.high is None else self.high)
        if std == 0.0:
            return float(value + guard < low or value - guard > high)
        return _share_below((low - guard - value) / std) + _share_below((value - guard - high) / std)

    @property
    def fail_probability_at_limit(self) -> float | None:
        """How likely a unit exactly at the nearest limit would have been measured *fail* here; None as above."""
        limits = [limit for limit in (self.low, self.high) if limit is not None]
        if self.value is None or self.std is None or not limits:
            return None
        reading = self.value
        return self.fail_probability(min(limits, key=lambda limit: abs(limit - reading)), self.std)

    def judged(self, limit: Limit) -> Measured:
        """The same, judged by another limit."""
        limited = replace(self, low=limit.low, high=limit.high)
        return replace(limited, verdict=limited.verdict_of_limits)

    def as_dict(self) -> dict[str, Any]:
        """As JSON values."""
        return plain(self)


def _share_below(deviation: float) -> float:
    """The share of a normal distribution below so many standard deviations."""
    return 0.5 * math.erfc(-deviation / math.sqrt(2.0))


def present_name(name: str) -> str:
    """`onset, 0 → 80 %` from `dead_time, 0 → 80 %`."""
    quantity, comma, place = name.partition(", ")
    return f"{RENAMED.get(quantity, quantity)}{comma}{place}"


def names_of(name: str) -> tuple[str, ...]:
    """`gain, high, 133…147 psi`, `gain, high`, `gain`: the names under which a measured value is known."""
    parts = name.split(", ")
    return tuple(", ".join(parts[:count]) for count in range(len(parts), 0, -1))


@dataclass(frozen=True, slots=True)
class Limit:
    """Where a measured value must lie; a limit belongs to what is allowed."""

    low: float | None = None
    high: float | None = None


def judge(
    value: float | None, std: float | None, low: float | None, high: float | None, relation: Relation = "="
) -> Verdict | None:
    """Pass, fail or cannot tell; None when there is no limit. A limit belongs to what is allowed."""
    if low is None and high is None:
        return None
    least, most = _interval(value, std, relation)
    lowest, highest = (-math.inf if low is None else low), (math.inf if high is None else high)
    if least >= lowest and most <= highest:
        return "pass"
    # a bound is never reached: "below 80" misses "at least 80"
    too_low = most <= lowest if relation == "<" else most < lowest
    too_high = least >= highest if relation == ">" else least > highest
    return "fail" if too_low or too_high else "cannot tell"


def _interval(value: float | None, std: float | None, relation: Relation) -> tuple[float, float]:
    if value is None or std is None or not math.isfinite(value) or not math.isfinite(std):
        return -math.inf, math.inf
    expanded = COVERAGE_FACTOR * std
    return (
        -math.inf if relation == "<" else value - expanded,
        math.inf if relation == ">" else value + expanded,
    )
