"""What a search, events and the one score make of the recordings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from hil.diagnosis.diagnosis import DiagnosisVerdict
from hil.diagnosis.events.event import Events
from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.search.fitted import Fitted
from hil.diagnosis.search.terms import Term
from hil.diagnosis.verdict.score import Table
from hil.record.recording import Array

OPEN = ("partly_explained", "unexplained")


@dataclass(frozen=True, slots=True)
class Choice:
    """The first row of the table, with the fits behind it.

    Attributes:
        verdict: of the first row.
        chosen: its terms and values, fitted together; no terms where it names none.
        baseline: the nominal model, base parameters moved within their prior. `nominal`: as it is.
        candidates: the sets that were fitted, best first.
        rivals: pairs of names, of which the data do not say which it is.
        terms: everything that was looked for.
        left: the share of the misfit that stays.
        alike: names that come nearest, where none is named.
        chances: how probable each name is.
        events: causes without a law that it names, those that were taken out of the recordings among them.
        residuals: whitened, with everything that it names; None where they are those of `chosen`.
        table: that it was read from; None below the gate.
        twins: sets that these data do not exclude.
    """

    verdict: DiagnosisVerdict
    chosen: Fitted
    baseline: Fitted
    nominal: Fitted
    candidates: tuple[Fitted, ...]
    rivals: tuple[tuple[str, str], ...]
    terms: tuple[Term, ...]
    left: float
    alike: tuple[str, ...] = ()
    chances: Mapping[str, float] = field(default_factory=dict)
    events: tuple[Events, ...] = ()
    residuals: Array | None = None
    table: Table | None = None
    twins: tuple[Fitted, ...] = ()


def has_drifted(problem: Problem, choice: Choice) -> bool:
    """Whether the nominal model is consistent with the recordings only with base parameters moved."""
    off = problem.excess(choice.nominal.chi2) >= problem.noise_uncertainty
    return choice.verdict == "consistent" and off and problem.excess(choice.baseline.chi2) < problem.noise_uncertainty
