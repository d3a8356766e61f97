"""What a procedure promises to measure, and what it found.

Every verdict of the program is made here: of a value by `judge`, of a run by `Findings.verdict`, and whether something
may be built on it by `is_accepted`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from hil.record.measured import COVERAGE_FACTOR, Limit, Measured, Relation, Verdict, judge, names_of, present_name

if TYPE_CHECKING:  # named in annotations alone; since.py needs pydantic, and procedures do not
    from hil.record.cause import Cause
    from hil.record.population_comparison import PopulationComparison
    from hil.record.previous_run import PreviousRunComparison

__all__ = [
    "AS_PLANNED",
    "COVERAGE_FACTOR",
    "FINDINGS_FILE",
    "RESULTS_FILE",
    "Findings",
    "Limit",
    "Measured",
    "Measurement",
    "Relation",
    "Verdict",
    "ended_as_planned",
    "ending_of",
    "is_accepted",
    "judge",
    "names_of",
    "present_name",
    "unproven",
    "without_kind",
]  # fmt: skip


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


RESULTS_FILE = "results.json"
FINDINGS_FILE = "findings.json"
"""In which versions before kept a part of the results; it is read where there is nothing else."""
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
        population: the unit beside good ones of its type, where the procedure knows them; no part of a verdict.
        since: the unit beside itself at an earlier date, where the archive has one; no part of a verdict.
        cause: why a certificate was missed, in physics, where that was asked; no part of a verdict.
    """

    measured: tuple[Measured, ...] = ()
    curves: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    deviations: tuple[str, ...] = ()
    population: PopulationComparison | None = None
    since: PreviousRunComparison | None = None
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


def unproven(verdict: Verdict | None) -> Verdict | None:
    """What a verdict comes to when the test was not gone through: what was missed stays missed."""
    return "cannot tell" if verdict == "pass" else verdict


def ending_of(meta: Mapping[str, Any]) -> str:
    """How a run, by its `meta`, ended otherwise than planned; empty for one that was completed, or was never a run."""
    outcome = str(meta.get("outcome", "it was never closed" if meta.get("procedure") else "completed"))
    return "" if outcome in AS_PLANNED else without_kind(outcome)


def without_kind(outcome: str) -> str:
    """How a run ended, as its folder has it, without the kind of its error: `TrippedError: interlock …`."""
    kind, _colon, why = outcome.partition(": ")
    return why if kind.endswith("Error") and kind.isidentifier() else outcome


def ended_as_planned(meta: Mapping[str, Any]) -> bool:
    """Whether a run was completed and nothing of it is missing."""
    return not ending_of(meta) and not meta.get("incomplete")


def is_accepted(verdict: Verdict | None) -> bool:
    """Whether what was judged may go on: proven, or not asked to be. What cannot be told was not proven."""
    return verdict in ("pass", None)
