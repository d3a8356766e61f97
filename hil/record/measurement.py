"""What a procedure promises to measure, what it found, and what that says about a limit.

The rule of decision is the guard band of ISO 14253-1 (JCGM 106 calls it guarded acceptance, and guarded
rejection on the other side): a value is known only within its expanded uncertainty U = 2·u, so it passes when
value ± U lies wholly inside the limits, fails when value ± U lies wholly outside, and otherwise nobody can tell.

Every verdict of the program is made here: of a value by `judge`, of a run by `Findings.verdict`, and whether something
may be built on it by `is_accepted`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from hil.record.plain import plain

if TYPE_CHECKING:
    from hil.record.cause import Cause
    from hil.record.population_comparison import PopulationComparison
    from hil.record.since import Since

Verdict = Literal["pass", "fail", "cannot tell"]
Relation = Literal["=", ">", "<"]
COVERAGE_FACTOR = 2.0


@dataclass(frozen=True, slots=True)
class Measurement:
    """A quantity that a procedure declares beside its code: what it means, and where it must lie.

    `definition` says how it is read, so that somebody else could: the standard's term, the range, what is in it.
    """

    name: str
    unit: str
    meaning: str
    low: float | None = None
    high: float | None = None
    definition: str = ""

    def at(self, place: str = "", unit: str = "") -> Measurement:
        """The same quantity at one of several places (`+50 ± 5 %`), or in a unit that only the bench knows."""
        return replace(self, name=f"{self.name}, {place}" if place else self.name, unit=unit or self.unit)

    def of(
        self, value: float | None, std: float | None = None, *, relation: Relation = "=", calibration: float = 0.0
    ) -> Measured:
        """What was found, judged by the declared limits.

        Args:
            value: in the declared unit; None when it could not be determined.
            std: its standard uncertainty as a repeat on this bench would show it, 0 for a count, None when it is not
                known.
            relation: `>` for a value that lies beyond what the test could reach ("−3 dB above 4.9 Hz"), `<` for one
                that noise alone could make.
            calibration: what the calibration of the instruments adds, as a standard uncertainty: the same in every
                run on this bench.
        """
        whole = None if std is None else math.hypot(std, calibration)
        verdict = judge(value, whole, self.low, self.high, relation)
        return Measured(
            self.name, value, self.unit, whole, self.low, self.high, verdict, relation, self.meaning, calibration
        )

    def size(self, value: float, std: float, *, calibration: float = 0.0) -> Measured:
        """What was found of a quantity that is never below zero: a bound where its uncertainty covers the value."""
        expanded = COVERAGE_FACTOR * math.hypot(std, calibration)
        if expanded < value:
            return self.of(value, std, calibration=calibration)
        return self.of(value + expanded, 0.0, relation="<")


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
    def names(self) -> tuple[str, ...]:
        """Under which it may be asked for: the whole name, then without the last parts of its place."""
        return names_of(self.name)

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
        return _below((low - guard - value) / std) + _below((value - guard - high) / std)

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
        verdict = judge(self.value, self.std, limit.low, limit.high, self.relation)
        return replace(self, low=limit.low, high=limit.high, verdict=verdict)

    def as_dict(self) -> dict[str, Any]:
        """As JSON values."""
        found: dict[str, Any] = plain(self)
        return found


def _below(deviation: float) -> float:
    """The share of a normal distribution below so many standard deviations."""
    return 0.5 * math.erfc(-deviation / math.sqrt(2.0))


def names_of(name: str) -> tuple[str, ...]:
    """`gain, high, 133…147 psi`, `gain, high`, `gain`: the names under which a measured value is known."""
    parts = name.split(", ")
    return tuple(", ".join(parts[:count]) for count in range(len(parts), 0, -1))


@dataclass(frozen=True, slots=True)
class Limit:
    """Where a measured value must lie; a limit belongs to what is allowed."""

    low: float | None = None
    high: float | None = None


FINDINGS_FILE = "findings.json"
AS_PLANNED = ("completed", "written")
"""Outcomes of a run that ended as planned, and of a recording that was written."""


@dataclass(frozen=True, slots=True)
class Findings:
    """What the evaluation of a run returns.

    Attributes:
        measured: every declared quantity.
        curves: results to draw, by name: frequency responses, flow curves, steps.
        notes: sentences that the reader of the report should know.
        deviations: where the test departed from its standard, a sentence each.
        likeness: the unit beside good ones of its type, where the procedure knows them; no part of a verdict.
        since: the unit beside itself at an earlier date, where the archive has one; no part of a verdict.
        cause: why a certificate was missed, in physics, where that was asked; no part of a verdict.
    """

    measured: tuple[Measured, ...] = ()
    curves: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    deviations: tuple[str, ...] = ()
    likeness: PopulationComparison | None = None
    since: Since | None = None
    cause: Cause | None = None

    @property
    def verdict(self) -> Verdict | None:
        """Of the whole run: the worst of its verdicts; None when nothing had a limit."""
        given = {found.verdict for found in self.measured}
        worst: tuple[Verdict, ...] = ("fail", "cannot tell", "pass")
        return next((verdict for verdict in worst if verdict in given), None)

    @property
    def open_or_missed(self) -> tuple[Measured, ...]:
        """What keeps the run from passing."""
        return tuple(found for found in self.measured if found.verdict in ("fail", "cannot tell"))

    def judged(self, limits: Mapping[str, Limit]) -> Findings:
        """The same, judged by limits for some quantities in place of the declared ones.

        A limit named as a quantity holds at every place, one named `quantity, place` there only; of a place of several
        parts (`high, 133…147 psi`) the first may do. What was not measured at all cannot be told.
        """
        named = [next((name for name in m.names if name in limits), None) for m in self.measured]
        judged = [m if name is None else m.judged(limits[name]) for m, name in zip(self.measured, named, strict=True)]
        missing = [Measured(name, None, "").judged(limit) for name, limit in limits.items() if name not in named]
        return replace(self, measured=(*judged, *missing))

    def with_missing(self, declared: Iterable[Measurement]) -> Findings:
        """The same, and every quantity that was declared with a limit and never found: it cannot be told."""
        found = {m.quantity for m in self.measured}
        missing = [m for m in declared if m.name not in found and not (m.low is None and m.high is None)]
        return replace(self, measured=(*self.measured, *(m.of(None) for m in missing)))

    def of_unfinished(self) -> Findings:
        """The same, of a run that did not end as planned: nothing in it has passed."""
        return replace(self, measured=tuple(replace(m, verdict=unproven(m.verdict)) for m in self.measured))

    def as_dict(self) -> dict[str, Any]:
        """Everything but the curves, as JSON values."""
        return {
            "verdict": self.verdict,
            "measured": [found.as_dict() for found in self.measured],
            "notes": list(self.notes),
            "deviations": list(self.deviations),
            **({} if self.likeness is None else {"likeness": self.likeness.as_dict()}),
        }


def unproven(verdict: Verdict | None) -> Verdict | None:
    """What a verdict comes to when the test was not gone through: what was missed stays missed."""
    return "cannot tell" if verdict == "pass" else verdict


def ending_of(meta: Mapping[str, Any]) -> str:
    """How a run, by its `meta`, ended otherwise than planned; empty for one that was completed, or was never a run."""
    outcome = str(meta.get("outcome", "it was never closed" if meta.get("procedure") else "completed"))
    return "" if outcome in AS_PLANNED else outcome


def ended_as_planned(meta: Mapping[str, Any]) -> bool:
    """Whether a run was completed and nothing of it is missing."""
    return not ending_of(meta) and not meta.get("incomplete")


def is_accepted(verdict: Verdict | None) -> bool:
    """Whether what was judged may go on: proven, or not asked to be. What cannot be told was not proven."""
    return verdict in ("pass", None)


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
