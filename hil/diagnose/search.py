"""Screen terms, fit them with the base parameters, and compare what each explains."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from hil.diagnose.problem import Problem
from hil.diagnose.terms import Term
from hil.identify.estimate import Estimate, Unknown, estimate
from hil.identify.experiment import Experiment
from hil.physics.simulate import ActiveEffect
from hil.record.recording import Array

_FROZEN = 1e6
# How the effort of refining is spread (see `refine_all`): evaluations, and how many terms and starts get more.
_SHORT, _LONG = 5, 30
_FAVOURITES = 2
_WORTH_A_TRY, _WORTH_MORE = 0.25, 0.75
_ROUGH, _ROUGH_EVALUATIONS = 1e-4, 15
# So many other valleys are tried where a misfit has many.
_VALLEYS = 2
# A first look takes sub-steps this much coarser; only what a term changes is simulated so.
_COARSE = 0.5
# A start is corrected when the line from nothing to it is lowest so far from it, and it is tried at this many times its
# strength at most.
_AS_STRONG, MOST_STRONGER = (0.8, 1.25), 3.0
# Of so many residuals at most is remembered what each term changes.
_SKETCHED = 80_000


@dataclass(frozen=True, slots=True)
class Fitted:
    """Terms with values.

    Attributes:
        terms, values: what was fitted, one tuple of values for each term.
        parameters: every base parameter, moved as far as its prior lets it.
        chi2: sum of squared residuals, the cost of moving base parameters included.
        residuals: whitened, shape (n,).
        estimate: of terms and base parameters together; None before `polish`.
    """

    terms: tuple[Term, ...]
    values: tuple[tuple[float, ...], ...]
    parameters: dict[str, float]
    chi2: float
    residuals: Array
    estimate: Estimate | None = None

    @property
    def unknowns(self) -> int:
        """Number of estimated values."""
        return sum(len(term.unknowns) for term in self.terms)

    @property
    def effects(self) -> list[ActiveEffect]:
        """The effects among the terms, as the simulation takes them."""
        found: list[ActiveEffect] = []
        for term, values in zip(self.terms, self.values, strict=True):
            term.apply(values, {}, found)
        return found

    @property
    def names(self) -> tuple[str, ...]:
        """The effects that the terms stand for; changed parameters have none."""
        named = (term.effect_name(values) for term, values in zip(self.terms, self.values, strict=True))
        return tuple(name for name in named if name)

    def only(self, keep: Sequence[int]) -> Fitted:
        """Some of the terms, as they are; base parameters that were the others go back. χ² and residuals stay."""
        back = {t.name: t.nominal for k, t in enumerate(self.terms) if t.kind == "parameter" and k not in keep}
        terms, values = tuple(self.terms[k] for k in keep), tuple(self.values[k] for k in keep)
        return replace(self, terms=terms, values=values, parameters=self.parameters | back, estimate=None)

    def estimate_index(self, term: Term) -> int:
        """Where the first unknown of a term stands in the estimate."""
        assert self.estimate is not None  # noqa: S101
        at = len(self.estimate.unknowns) - self.unknowns
        for other in self.terms:
            if other is term:
                return at
            at += len(other.unknowns)
        raise KeyError(term.label)

    def on_bound(self) -> tuple[str, ...]:
        """Unknowns of the terms that ended on a bound of theirs."""
        return tuple(
            f"{term.name}.{u.name}"
            for term, values in zip(self.terms, self.values, strict=True)
            for u, value in zip(term.unknowns, values, strict=True)
            if u.at_bound(value)
        )


@dataclass(frozen=True, slots=True)
class Screened:
    """A term with its starts, the best first, and the χ² of that one.

    `changes`: what it changes at each start (see `sketch`), where that is remembered.
    """

    term: Term
    starts: tuple[tuple[float, ...], ...]
    chi2: float
    changes: tuple[NDArray[np.float32], ...]


@dataclass(frozen=True)
class Around:
    """A point of the search: what is accepted, and how residuals move with everything that may adapt."""

    problem: Problem
    accepted: Fitted
    slopes: Array  # (n, base + accepted unknowns)

    @cached_property
    def gram(self) -> Array:
        """Inner products of the slopes, shape (k, k)."""
        product: Array = self.slopes.T @ self.slopes
        return product

    @cached_property
    def residuals_without(self) -> Array:
        """With no term more, after all that may adapt has adapted linearly."""
        return adapted_residuals(self, None)

    @cached_property
    def coarse_residuals(self) -> Array:
        """Of what is accepted, with coarser sub-steps."""
        return residuals_of(self.problem, self.accepted, factor=_COARSE * self.problem.factor)


@cache
def pool() -> ThreadPoolExecutor:
    """Threads for simulations that do not wait for each other."""
    return ThreadPoolExecutor(os.cpu_count() or 1, thread_name_prefix="search")


def nothing(problem: Problem) -> Fitted:
    """No term: the nominal model."""
    r = problem.nominal_residuals
    return Fitted((), (), dict(problem.model.values), float(r @ r), r)


def around(problem: Problem, accepted: Fitted) -> Around:
    """Linearise around what is accepted so far."""
    effects = [*problem.model.active_effects, *accepted.effects]
    base = problem.base_jacobian(accepted.parameters, effects, accepted.residuals)
    own = [_term_slopes(problem, accepted, k) for k in range(len(accepted.terms))]
    return Around(problem, accepted, np.hstack([base, *own]))


def _term_slopes(problem: Problem, accepted: Fitted, k: int) -> Array:
    columns = []
    for i, unknown in enumerate(accepted.terms[k].unknowns):
        step = 1e-3 * unknown.scale
        values = [list(v) for v in accepted.values]
        if values[k][i] + step > unknown.high:
            step = -step
        values[k][i] += step
        moved = _simulate(problem, accepted.parameters, accepted.terms, values)
        columns.append((moved - accepted.residuals) / step)
    return np.column_stack(columns)


def residuals_of(
    problem: Problem, f: Fitted, *, factor: float | None = None, experiments: Sequence[Experiment] | None = None
) -> Array:
    """Whitened residuals of an explanation as it stands, shape (n,); the rest as in `Problem.residuals`."""
    return _simulate(problem, f.parameters, f.terms, f.values, factor, experiments)


def _simulate(
    problem: Problem,
    parameters: dict[str, float],
    terms: Sequence[Term],
    values: Sequence[Sequence[float]],
    factor: float | None = None,
    experiments: Sequence[Experiment] | None = None,
) -> Array:
    moved, effects = dict(parameters), list(problem.model.active_effects)
    for term, own in zip(terms, values, strict=True):
        term.apply(own, moved, effects)
    return problem.residuals(moved, effects, factor=factor, experiments=experiments)


def _with_term(place: Around, term: Term, values: Sequence[float], coarse: bool = False) -> Array:
    """Residuals with one more term beside what is accepted."""
    accepted, problem = place.accepted, place.problem
    terms, own = (*accepted.terms, term), (*accepted.values, values)
    if not coarse:
        return _simulate(problem, accepted.parameters, terms, own)
    change = _simulate(problem, accepted.parameters, terms, own, _COARSE * problem.factor) - place.coarse_residuals
    return accepted.residuals + change


def adapted_residuals(place: Around, added: tuple[Term, Sequence[float]] | None, *, coarse: bool = False) -> Array:
    """Residuals with one more term, or without, after all else has adapted linearly, shape (n + base,)."""
    if added is None:
        return _adapt(place, place.accepted.residuals, None)[0]
    return _adapt(place, _with_term(place, *added, coarse), added[0])[0]


def _adapt(place: Around, r: Array, term: Term | None) -> tuple[Array, Array]:
    """Residuals after everything but `term` has adapted linearly, with the cost of it appended; the moves."""
    prior, away = _prior(place, term)
    cost = prior @ away
    information = place.gram + prior.T @ prior
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    pull = scale * (place.slopes.T @ r + prior.T @ cost)
    moves = -scale * np.linalg.lstsq(information * np.outer(scale, scale), pull, rcond=1e-12)[0]
    return np.concatenate([r + place.slopes @ moves, cost + prior @ moves]), moves


def _prior(place: Around, term: Term | None) -> tuple[Array, Array]:
    """What moving costs: rows (base, columns) of a root of the prior's precision, and how far away we are already.

    Base parameters that are terms do not adapt; an effect stands for the base parameter of its name.
    """
    problem, accepted = place.problem, place.accepted
    taken = {t.name for t in accepted.terms if t.kind == "parameter"} | ({term.name} if term else set())
    free = [k for k, p in enumerate(problem.base) if p.name not in taken]
    rows = np.zeros((len(problem.base), place.slopes.shape[1]))
    rows[np.ix_(free, free)] = prior_root(problem, free)
    away = np.zeros(place.slopes.shape[1])
    for k, p in enumerate(problem.base):
        if p.name in taken:
            rows[k, k] = _FROZEN / problem.prior_std[k]
        else:
            away[k] = accepted.parameters[p.name] - problem.model.values[p.name]
    return rows, away


def prior_root(problem: Problem, free: Sequence[int]) -> Array:
    """R with Rᵀ·R the precision of these base parameters under the prior."""
    covariance = problem.prior_covariance[np.ix_(free, free)]
    root: Array = np.linalg.inv(np.linalg.cholesky(covariance))
    return root


def screen(place: Around, terms: Sequence[Term], *, remember: bool = False) -> list[Screened]:
    """Every term at its starts, all else adapting linearly; the term with the best start first.

    A start too strong or too weak is corrected: where the straight line from nothing to what it does is lowest.
    `remember`: what each term changes at each start, for `hil.diagnose.joint`.
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
    return list(pool().map(lambda job: _tried(place, job[0], job[1], remember), jobs))


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
    if share == 0.0 or _AS_STRONG[0] < share < _AS_STRONG[1] or better == start:
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


@dataclass(frozen=True, slots=True)
class Effort:
    """How much is tried when terms are refined.

    Attributes:
        tried: so many terms at most get a few steps. `leading`: so many of them more.
        other_starts: starts from which the best few are fitted.
    """

    tried: int
    leading: int
    other_starts: int


THOROUGH, LEAN = Effort(16, 5, 3), Effort(8, 3, 1)


def refine_all(place: Around, screened: Sequence[Screened], effort: Effort = THOROUGH) -> list[Fitted]:
    """Fit the screened terms beside what is accepted, everything else adapting linearly. Best first.

    The promising ones get a few steps from their best start. Those whose gain comes near the best one's get more,
    and the best few also try other starts: a sticking part has local optima.
    """
    promising = screened[: _count(place, [s.chi2 for s in screened], _WORTH_A_TRY, effort.tried)]
    tried = _refine_many(place, [(s, s.starts[0]) for s in promising], _SHORT, coarse=True)
    by_chi2 = sorted(zip(tried, promising, strict=True), key=lambda pair: pair[0].chi2)
    count = _count(place, [f.chi2 for f, _ in by_chi2], _WORTH_MORE, effort.leading)
    leading, rest = by_chi2[:count], by_chi2[count:]
    again = [(s, f.values[-1]) for f, s in leading]
    again += [(s, start) for _, s in leading[:_FAVOURITES] for start in s.starts[1 : effort.other_starts]]
    longer = _refine_many(place, again, _LONG)
    longer += _refine_many(place, _off_bounds(longer[: len(leading)], leading), _LONG)
    best: dict[int, Fitted] = {}
    for f in longer:
        key = id(f.terms[-1])
        if key not in best or f.chi2 < best[key].chi2:
            best[key] = f
    return sorted([*best.values(), *(f for f, _ in rest)], key=lambda f: f.chi2)


def _off_bounds(
    fits: Sequence[Fitted], leading: Sequence[tuple[Fitted, Screened]]
) -> list[tuple[Screened, tuple[float, ...]]]:
    """Where a fit ran into the bound of a shape parameter, another try from well inside."""
    jobs = []
    for f, (_, screened) in zip(fits, leading[:_FAVOURITES], strict=False):
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
    place: Around, jobs: Sequence[tuple[Screened, tuple[float, ...]]], evaluations: int, *, coarse: bool = False
) -> list[Fitted]:
    def one(job: tuple[Screened, tuple[float, ...]]) -> Fitted:
        return refine(place, job[0].term, job[1], evaluations=evaluations, coarse=coarse)

    return list(pool().map(one, jobs))


def refine(
    place: Around, term: Term, start: tuple[float, ...], *, evaluations: int = 25, coarse: bool = False
) -> Fitted:
    """Fit one term from a start, everything else adapting linearly."""

    def residuals(values: Array) -> Array:
        return adapted_residuals(place, (term, values.tolist()), coarse=coarse)

    found = estimate(residuals, _starting(term.unknowns, start), max_evaluations=evaluations, tolerance=1e-4)
    values = tuple(float(v) for v in found.values)
    r = _with_term(place, term, values, coarse)
    _, moves = _adapt(place, r, term)
    return _moved(place, (*place.accepted.terms, term), values, moves, found.chi2, r)


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


def _starting(unknowns: Sequence[Unknown], start: Sequence[float]) -> list[Unknown]:
    return [Unknown(u.name, u.unit, s, u.low, u.high, u.scale) for u, s in zip(unknowns, start, strict=True)]


def _better_start(residuals: Callable[[Array], Array], unknowns: list[Unknown], nominal: Array) -> list[Unknown]:
    """The unknowns as they are, or with base parameters at their nominal values: linear moves may have gone too far."""
    moved = np.array([u.start for u in unknowns])
    back = np.concatenate([nominal, moved[len(nominal) :]])
    if np.array_equal(moved, back):
        return unknowns
    far, near = (float(r @ r) for r in (residuals(moved), residuals(back)))
    if not near < far:
        return unknowns
    return [replace(u, start=float(v)) for u, v in zip(unknowns, back, strict=True)]


def polish(
    problem: Problem,
    fitted: Fitted,
    *,
    base_free: bool = False,
    keep: NDArray[np.bool_] | None = None,
    evaluations: int = 40,
    tolerance: float = 1e-5,
) -> Fitted:
    """Fit terms and base parameters together, nothing linearised.

    Args:
        problem: the question.
        fitted: terms and where to start.
        base_free: let base parameters go as far as they like instead of as far as their prior lets them.
        keep: which residuals count, shape (n,); the others are for judging.
        evaluations: at most.
        tolerance: relative fall of χ² at which to stop.
    """
    taken = {term.name for term in fitted.terms if term.kind == "parameter"}
    free = [k for k, p in enumerate(problem.base) if p.name not in taken]
    base = [problem.base[k] for k in free]
    root = prior_root(problem, free)
    nominal = np.array([problem.model.values[p.name] for p in base])
    unknowns = [Unknown(p.name, p.unit, fitted.parameters[p.name], p.low, p.high, p.scale) for p in base]
    for term, values in zip(fitted.terms, fitted.values, strict=True):
        unknowns += _starting(term.unknowns, values)
    count, names = len(base), [p.name for p in base]

    def split(values: Array) -> tuple[dict[str, float], list[tuple[float, ...]]]:
        parameters = problem.model.values | dict(zip(names, values[:count].tolist(), strict=True))
        own, at = [], count
        for term in fitted.terms:
            own.append(tuple(values[at : at + len(term.unknowns)].tolist()))
            at += len(term.unknowns)
        return parameters, own

    def residuals(values: Array) -> Array:
        parameters, own = split(values)
        r = _simulate(problem, parameters, fitted.terms, own)
        r = r if keep is None else r[keep]
        return r if base_free else np.concatenate([r, root @ (values[:count] - nominal)])

    found = estimate(
        residuals, _better_start(residuals, unknowns, nominal), max_evaluations=evaluations, tolerance=tolerance
    )
    parameters, own = split(found.values)
    r = _simulate(problem, parameters, fitted.terms, own)
    for term, values in zip(fitted.terms, own, strict=True):
        if term.kind == "parameter":
            parameters[term.name] = values[0]
    return Fitted(fitted.terms, tuple(own), parameters, found.chi2, r, found)


def roughly(problem: Problem, start: Fitted, *, base_free: bool = False) -> Fitted:
    """A first look, which need not creep along a valley to its end."""
    return polish(problem, start, base_free=base_free, tolerance=_ROUGH, evaluations=_ROUGH_EVALUATIONS)


def from_other_shapes(problem: Problem, f: Fitted) -> Fitted:
    """The same explanation, every rugged term fitted once more from the shapes of its starts; the lowest of all."""
    for k, term in enumerate(f.terms):
        if term.rugged:
            f = _lowest_valley(problem, f, k)
    return f


def _lowest_valley(problem: Problem, f: Fitted, k: int) -> Fitted:
    size = f.values[k][0]
    shapes = dict.fromkeys((size, *shape) for _, *shape in f.terms[k].starts)
    tried = [(*f.values[:k], own, *f.values[k + 1 :]) for own in shapes]

    def chi2(values: tuple[tuple[float, ...], ...]) -> float:
        r = _simulate(problem, f.parameters, f.terms, values)
        return float(r @ r)

    nearest = [values for _, values in sorted(zip(pool().map(chi2, tried), tried, strict=True))[:_VALLEYS]]
    best = min((roughly(problem, replace(f, values=values)) for values in nearest), key=lambda other: other.chi2)
    return min(f, polish(problem, best), key=lambda other: other.chi2) if best.chi2 < f.chi2 else f
