"""A first look at every term: at a few strengths, all else adapting linearly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.cores import spread
from hil.diagnosis.search.around import Around, adapted_residuals
from hil.diagnosis.search.terms import Term
from hil.diagnosis.yardsticks import MUCH_THE_SAME
from hil.record.recording import Array

# A start is tried at this many times its strength at most.
MOST_STRONGER = 3.0
# Of so many residuals at most is remembered what each term changes.
_SKETCHED = 80_000


@dataclass(frozen=True, slots=True)
class Screened:
    """A term with its starts, the best first, and the χ² of that one.

    `changes`: what it changes at each start (see `sketch`), where that is remembered.
    """

    term: Term
    starts: tuple[tuple[float, ...], ...]
    chi2: float
    changes: tuple[NDArray[np.float32], ...]


def screen(place: Around, terms: Sequence[Term], *, remember: bool = False) -> list[Screened]:
    """Every term at its starts, all else adapting linearly; the term with the best start first.

    A start too strong or too weak is corrected: where the straight line from nothing to what it does is lowest.
    `remember`: what each term changes at each start, for `hil.diagnosis.search.joint`.
    """
    place.coarse_residuals, place.residuals_without  # noqa: B018  computed once, before threads ask for it
    tried = _try(place, [(term, start) for term in terms for start in term.starts], remember)
    corrected = _try(place, [(t.term, t.better) for t in _most_promising(tried) if t.better], remember)
    found: dict[int, list[_Tried]] = {id(term): [] for term in terms}
    for t in [*tried, *corrected]:
        found[id(t.term)].append(t)
    return sorted((_screened(own) for own in found.values()), key=lambda s: s.chi2)


@dataclass(frozen=True, slots=True)
class _Tried:
    """A term at a start, and at which start the line towards it is lowest; () when that is much the same.

    `change`: what it changes there, or () when that is not remembered.
    """

    term: Term
    start: tuple[float, ...]
    chi2: float
    change: tuple[NDArray[np.float32], ...]
    better: tuple[float, ...]
    chi2_there: float


def _try(place: Around, jobs: Sequence[tuple[Term, tuple[float, ...]]], remember: bool) -> list[_Tried]:
    """Terms at starts, in one batch."""
    return spread(lambda job: _tried(place, job[0], job[1], remember), jobs)


def _tried(place: Around, term: Term, start: tuple[float, ...], remember: bool) -> _Tried:
    adapted = adapted_residuals(place, (term, start), coarse=True)
    chi2 = float(adapted @ adapted)
    if not np.isfinite(chi2):
        return _Tried(term, start, np.inf, (sketch(np.zeros_like(adapted)),) if remember else (), (), np.inf)
    change = adapted - place.residuals_without
    sketched = (sketch(change),) if remember else ()
    if not term.scales:
        return _Tried(term, start, chi2, sketched, (), chi2)
    length = float(change @ change)
    share = float(np.clip(-(place.residuals_without @ change) / length, 0.0, MOST_STRONGER)) if length else 0.0
    better = term.scaled(start, share)
    if share == 0.0 or 1.0 / MUCH_THE_SAME < share < MUCH_THE_SAME or better == start:
        return _Tried(term, start, chi2, sketched, (), chi2)
    there = place.residuals_without + share * change
    return _Tried(term, start, chi2, sketched, better, float(there @ there))


def sketch(residuals: Array) -> NDArray[np.float32]:
    """As many of the residuals as suffice to compare what terms change, at half the precision."""
    return residuals[:: 1 + len(residuals) // _SKETCHED].astype(np.float32)


def _most_promising(tried: Sequence[_Tried]) -> list[_Tried]:
    """For each term the start whose line goes lowest."""
    best: dict[int, _Tried] = {}
    for t in tried:
        if id(t.term) not in best or t.chi2_there < best[id(t.term)].chi2_there:
            best[id(t.term)] = t
    return list(best.values())


def _screened(tried: Sequence[_Tried]) -> Screened:
    order = sorted(tried, key=lambda t: (t.chi2, t.start))
    return Screened(
        order[0].term, tuple(t.start for t in order), order[0].chi2, tuple(c for t in order for c in t.change)
    )
