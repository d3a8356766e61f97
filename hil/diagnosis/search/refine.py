"""Fit screened terms one by one beside what is accepted, everything else adapting linearly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from hil.cores import spread
from hil.diagnosis.search.around import Around, adapt, adapted_residuals, with_term
from hil.diagnosis.search.fitted import Fitted, starting
from hil.diagnosis.search.screen import Screened
from hil.diagnosis.search.terms import Term
from hil.diagnosis.yardsticks import AT_A_GLANCE, FEW, LEADING, MANY, ROUGHLY, Effort
from hil.identification.estimate import estimate
from hil.record.recording import Array

# What gains so much of what the best gains is worth a try, and worth more (see `refine_all`).
_WORTH_A_TRY, _WORTH_MORE = 0.25, 0.75


@dataclass(frozen=True, slots=True)
class Width:
    """How much is tried when terms are refined.

    Attributes:
        tried: so many terms at most get a few steps. `leading`: so many of them more.
        other_starts: starts from which the best few are fitted.
    """

    tried: int
    leading: int
    other_starts: int


THOROUGH, LEAN = Width(2 * MANY, FEW, 3), Width(MANY, FEW, 1)


def refine_all(place: Around, screened: Sequence[Screened], width: Width = THOROUGH) -> list[Fitted]:
    """Fit the screened terms beside what is accepted, everything else adapting linearly. Best first.

    The promising ones get a few steps from their best start. Those whose gain comes near the best one's get more,
    and the best few also try other starts: a sticking part has local optima.
    """
    promising = screened[: _count(place, [s.chi2 for s in screened], _WORTH_A_TRY, width.tried)]
    tried = _refine_many(place, [(s, s.starts[0]) for s in promising], AT_A_GLANCE, coarse=True)
    by_chi2 = sorted(zip(tried, promising, strict=True), key=lambda pair: pair[0].chi2)
    count = _count(place, [f.chi2 for f, _ in by_chi2], _WORTH_MORE, width.leading)
    leading, rest = by_chi2[:count], by_chi2[count:]
    again = [(s, f.values[-1]) for f, s in leading]
    again += [(s, start) for _, s in leading[:LEADING] for start in s.starts[1 : width.other_starts]]
    longer = _refine_many(place, again, ROUGHLY)
    longer += _refine_many(place, _off_bounds(longer[: len(leading)], leading), ROUGHLY)
    best: dict[int, Fitted] = {}
    for f in longer:
        key = id(f.terms[-1])
        if key not in best or f.chi2 < best[key].chi2:
            best[key] = f
    return sorted([*best.values(), *(f for f, _ in rest)], key=lambda f: f.chi2)


def refine(place: Around, term: Term, start: tuple[float, ...], *, effort: Effort, coarse: bool = False) -> Fitted:
    """Fit one term from a start, everything else adapting linearly."""

    def residuals(values: Array, coarse: bool = coarse) -> Array:
        return adapted_residuals(place, (term, values.tolist()), coarse=coarse)

    found = estimate(
        residuals,
        starting(term.unknowns, start),
        sketch=None if coarse else partial(residuals, coarse=True),
        max_evaluations=effort.evaluations,
        tolerance=effort.tolerance,
    )
    values = tuple(float(v) for v in found.values)
    r = with_term(place, term, values, coarse)
    _, moves = adapt(place, r, term)
    return _moved(place, (*place.accepted.terms, term), values, moves, found.chi2, r)


def _off_bounds(
    fits: Sequence[Fitted], leading: Sequence[tuple[Fitted, Screened]]
) -> list[tuple[Screened, tuple[float, ...]]]:
    """Where a fit ran into the bound of a shape parameter, another try from well inside."""
    jobs = []
    for f, (_, screened) in zip(fits, leading[:LEADING], strict=False):
        moved = [
            u.low + 0.3 * (u.high - u.low) if k > 0 and u.at_bound(v) else v
            for k, (v, u) in enumerate(zip(f.values[-1], screened.term.unknowns, strict=True))
        ]
        if tuple(moved) != f.values[-1]:
            jobs.append((screened, tuple(moved)))
    return jobs


def _count(place: Around, chi2: Sequence[float], share: float, most: int) -> int:
    """How many of these (best first) gain at least a share of what the best gains, at most `most`; all of those
    where nothing gains much.
    """
    gain = place.accepted.chi2 - chi2[0]
    if gain < 0.05 * place.accepted.chi2:
        return min(most, len(chi2))
    return min(most, max(1, sum(value <= place.accepted.chi2 - share * gain for value in chi2)))


def _refine_many(
    place: Around, jobs: Sequence[tuple[Screened, tuple[float, ...]]], effort: Effort, *, coarse: bool = False
) -> list[Fitted]:
    def one(job: tuple[Screened, tuple[float, ...]]) -> Fitted:
        return refine(place, job[0].term, job[1], effort=effort, coarse=coarse)

    return spread(one, jobs)


def _moved(
    place: Around, terms: tuple[Term, ...], last: tuple[float, ...], moves: Array, chi2: float, r: Array
) -> Fitted:
    """The point that the linear moves lead to (its residuals are those before the moves)."""
    problem, accepted = place.problem, place.accepted
    count = len(problem.base)
    parameters = dict(accepted.parameters)
    for p, move in zip(problem.base, moves[:count], strict=True):
        parameters[p.name] = float(np.clip(parameters[p.name] + move, p.low, p.high))
    values, at = [], count
    for term, own in zip(accepted.terms, accepted.values, strict=True):
        shifted = [
            float(np.clip(v + m, u.low, u.high))
            for v, m, u in zip(own, moves[at : at + len(own)], term.unknowns, strict=True)
        ]
        at += len(own)
        values.append(tuple(shifted))
    return Fitted(terms, (*values, last), parameters, chi2, r)
