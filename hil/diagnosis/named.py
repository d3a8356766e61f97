"""A name for a change beyond the gate: the terms that it may be, fitted, and one score for all of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from hil.cores import spread
from hil.diagnosis.changed import Changed
from hil.diagnosis.decide import Choice
from hil.diagnosis.diagnosis import Verdict
from hil.diagnosis.problem import Problem
from hil.diagnosis.search.fitted import Fitted, nothing, simulated, starting
from hil.diagnosis.search.terms import Term, all_terms
from hil.diagnosis.yardsticks import AT_A_GLANCE, ROUGHLY, Effort
from hil.identification.estimate import estimate
from hil.record.recording import Array

# Terms that are fitted, those of the largest linear gain, from how many starts, and how many are fitted further.
_FITTED, _STARTS, _FURTHER = 16, 2, 6


@dataclass(frozen=True, slots=True)
class Criteria:
    """What decides between names.

    Attributes:
        parts: what is left counts as this many parts with what is not. `cause`: what one costs, per part.
        unknown: what something unknown leaves of what its partner, or nothing, leaves. `unknowns`: it has.
        alike: what is no further behind the best is as good. `temper`: odds are exp(−ΔS/2·temper).
        scale: the least χ² of any hypothesis is taken for noise within these times its expectation.
    """

    parts: float = 100.0
    cause: float = 1.1
    unknown: float = 0.1
    unknowns: int = 3
    alike: float = 20.0
    temper: float = 10.0
    scale: tuple[float, float] = (0.4, 1.1)


CRITERIA = Criteria()


def unchanged(changed: Changed) -> Choice:
    """Below the gate nothing is named, whatever a hypothesis gains."""
    problem = changed.judged
    nominal = nothing(problem)
    return Choice("consistent", nominal, nominal, nominal, (), (), all_terms(problem, nominal.residuals), 1.0)


def named(changed: Changed) -> Choice:
    """The most economical name of a change; base parameters stay where identification knew them."""
    problem = changed.judged
    nominal = nothing(problem)
    terms = all_terms(problem, nominal.residuals)
    problem.work.at(0.2, "fitting what may have changed")
    fits = _fitted(changed, problem, terms)
    chi2 = [changed.chi2(f.residuals) for f in fits]
    score = _Score(changed, changed.chi2(nominal.residuals), chi2, len({t.label for t in terms}))
    lefts = [score.left(each) for each in chi2]
    own = [score.of(left, f.unknowns, 1) for f, left in zip(fits, lefts, strict=True)]
    order = np.argsort(own, kind="stable")
    ranked = [fits[k] for k in order]
    best, left = ranked[0], lefts[order[0]]
    unknown = score.of(CRITERIA.unknown * score.whole, CRITERIA.unknowns, 1)
    beside = score.of(CRITERIA.unknown * left, best.unknowns + CRITERIA.unknowns, 2)
    verdict: Verdict = "explained" if best.names else "parameter_change"
    if unknown - min(own) <= CRITERIA.alike:  # a name that something unknown is as good as is none
        verdict = "unexplained" if unknown <= beside else "partly_explained"
    elif beside < min(own):
        verdict = "partly_explained"
    as_good = max(min(own), unknown if verdict == "unexplained" else -math.inf) + CRITERIA.alike
    alike = dict.fromkeys(_name(fits[k]) for k in order if own[k] <= as_good)
    first, *others = alike or (_name(best),)
    share = left / max(score.whole, 1e-9)
    rivals = tuple((first, other) for other in others)
    chances = _chances(score, fits, lefts, own, unknown)
    return Choice(
        verdict, best, nominal, nominal, tuple(ranked), rivals, terms, share, alike=tuple(alike), chances=chances
    )


def _chances(
    score: _Score, fits: Sequence[Fitted], lefts: Sequence[float], own: Sequence[float], unknown: float
) -> dict[str, float]:
    """How probable each name is among all rows: each alone, each with something unknown beside it, and that alone."""
    beside = [
        score.of(CRITERIA.unknown * left, f.unknowns + CRITERIA.unknowns, 2)
        for f, left in zip(fits, lefts, strict=True)
    ]
    every = np.array([*own, *beside, unknown])
    weights = np.exp(-(every - every.min()) / (2.0 * CRITERIA.temper))
    found: dict[str, float] = {}
    for f, weight in zip([*fits, *fits], weights / weights.sum(), strict=False):
        found[_name(f)] = found.get(_name(f), 0.0) + float(weight)
    return found


def _name(f: Fitted) -> str:
    """The effect, or the parameter, of a single cause."""
    return f.names[0] if f.names else f.terms[0].name


@dataclass(frozen=True)
class _Score:
    """S = m·ln(1 + E/m) + c·(γ·m + 2·ln T) + k·ln N: less is better.

    E is what a hypothesis leaves beyond noise, the least χ² of all being noise as far as its scale is uncertain.
    """

    changed: Changed
    nothing: float
    others: Sequence[float]
    names: int

    @property
    def noise(self) -> float:
        """χ² of noise alone."""
        low, high = (times * self.changed.count for times in CRITERIA.scale)
        return float(np.clip(min((self.nothing, *self.others)), low, high))

    def left(self, chi2: float) -> float:
        """E of a hypothesis."""
        return max(chi2 - self.noise, 0.0) * self.changed.count / self.noise

    @property
    def whole(self) -> float:
        """E of the unit as it was."""
        return self.left(self.nothing)

    def of(self, left: float, unknowns: int, causes: int) -> float:
        """S of a hypothesis that leaves E."""
        price = CRITERIA.cause * CRITERIA.parts + 2.0 * math.log(max(self.names, 1))
        cost = causes * price + unknowns * math.log(self.changed.count)
        return CRITERIA.parts * math.log1p(left / CRITERIA.parts) + cost


def _fitted(changed: Changed, problem: Problem, terms: Sequence[Term]) -> list[Fitted]:
    """The terms of the largest linear gain, each at its best."""
    gains: dict[tuple[str, str], float] = {}
    for column, z in zip(changed.table.columns, changed.later.every, strict=True):
        gains[column.name, column.hook] = max(abs(float(z)), gains.get((column.name, column.hook), 0.0))
    known = [t for t in terms if (t.name, t.hook) in gains]
    likely = sorted(known, key=lambda t: -gains[t.name, t.hook])[:_FITTED]
    roughly = [f for own in spread(partial(_from_starts, problem), likely) for f in own]
    first: dict[str, Fitted] = {}
    for f in sorted(roughly, key=lambda f: f.chi2):
        first.setdefault(f.terms[0].label, f)
    return spread(partial(_further, problem), list(first.values())[:_FURTHER]) + list(first.values())[_FURTHER:]


def _from_starts(problem: Problem, term: Term) -> list[Fitted]:
    def chi2(start: tuple[float, ...]) -> float:
        r = simulated(problem, dict(problem.model.values), [term], [start])
        return float(r @ r)

    starts = sorted(term.starts, key=chi2)[:_STARTS]
    return [_fit(problem, term, start, AT_A_GLANCE) for start in starts]


def _further(problem: Problem, f: Fitted) -> Fitted:
    return _fit(problem, f.terms[0], f.values[0], ROUGHLY)


def _fit(problem: Problem, term: Term, start: Sequence[float], effort: Effort) -> Fitted:
    parameters = dict(problem.model.values)

    def residuals(values: Array) -> Array:
        return simulated(problem, parameters, [term], [tuple(values.tolist())])

    found = estimate(
        residuals, starting(term.unknowns, start), max_evaluations=effort.evaluations, tolerance=effort.tolerance
    )
    values = tuple(found.values.tolist())
    moved = parameters | ({term.name: values[0]} if term.kind == "parameter" else {})
    return Fitted((term,), (values,), moved, found.chi2, found.residuals, found)
