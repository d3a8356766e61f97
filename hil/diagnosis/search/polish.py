"""Fit terms and base parameters together, nothing linearised."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hil.cores import spread
from hil.diagnosis.problem import Problem
from hil.diagnosis.search.fitted import Fitted, evaluated, residuals_of, simulated, starting
from hil.diagnosis.yardsticks import FAR, LEADING, ROUGHLY, SELDOM_BY_CHANCE, TO_THE_END, Effort
from hil.identification.estimate import Unknown, estimate
from hil.record.recording import Array


def polish(problem: Problem, fitted: Fitted, *, from_here: bool = False) -> Fitted:
    """Fit terms and base parameters together to the end, nothing linearised; `from_here` as in `fit`.

    A rugged term that pulled base parameters far off is fitted once more from their nominal values: it may have ended
    in a valley from which only they had a way on.
    """
    found = fit(problem, fitted, from_here=from_here)
    bent = set(problem.prior.moved(found.parameters)) - {term.name for term in found.terms if term.kind == "parameter"}
    if not (bent and any(term.rugged for term in found.terms)):
        return found
    nominal = found.parameters | {p.name: problem.model.values[p.name] for p in problem.base}
    again = roughly(problem, replace(found, parameters=nominal))
    return min(found, fit(problem, again), key=lambda f: f.chi2) if again.chi2 < found.chi2 else found


def fit(
    problem: Problem,
    fitted: Fitted,
    *,
    base_free: bool = False,
    keep: NDArray[np.bool_] | None = None,
    effort: Effort = TO_THE_END,
    from_here: bool = False,
) -> Fitted:
    """Fit terms and base parameters together from one start, nothing linearised.

    Args:
        problem: the question.
        fitted: terms and where to start.
        base_free: let base parameters go as far as they like instead of as far as their prior lets them.
        keep: which residuals count, shape (n,); the others are for judging.
        effort: how far to go.
        from_here: start with base parameters as they are, even where their nominal values would be a better start.
    """
    taken = {term.name for term in fitted.terms if term.kind == "parameter"}
    free = [k for k, p in enumerate(problem.base) if p.name not in taken]
    base = [problem.base[k] for k in free]
    root = problem.prior.root(free)
    nominal = np.array([problem.model.values[p.name] for p in base])
    unknowns = [Unknown(p.name, p.unit, fitted.parameters[p.name], p.low, p.high, p.scale) for p in base]
    for term, values in zip(fitted.terms, fitted.values, strict=True):
        unknowns += starting(term.unknowns, values)
    count, names = len(base), [p.name for p in base]

    def split(values: Array) -> tuple[dict[str, float], list[tuple[float, ...]]]:
        parameters = problem.model.values | dict(zip(names, values[:count].tolist(), strict=True))
        own, at = [], count
        for term in fitted.terms:
            own.append(tuple(values[at : at + len(term.unknowns)].tolist()))
            at += len(term.unknowns)
        return parameters, own

    def residuals(values: Array, factor: float = problem.factor) -> Array:
        parameters, own = split(values)
        r = simulated(problem, parameters, fitted.terms, own, factor)
        r = r if keep is None else r[keep]
        return r if base_free else np.concatenate([r, root @ (values[:count] - nominal)])

    found = estimate(
        residuals,
        unknowns if from_here else _better_start(residuals, unknowns, nominal),
        sketch=partial(residuals, factor=problem.coarse_factor),
        max_evaluations=effort.evaluations,
        tolerance=effort.tolerance,
    )
    parameters, own = split(found.values)
    r = simulated(problem, parameters, fitted.terms, own)
    for term, values in zip(fitted.terms, own, strict=True):
        if term.kind == "parameter":
            parameters[term.name] = values[0]
    return Fitted(fitted.terms, tuple(own), parameters, found.chi2, r, found)


def finished(problem: Problem, f: Fitted) -> Fitted:
    """The same explanation as exact as it can be told.

    Sub-steps whose error is next to nothing for a verdict may still move a value by its uncertainty, as where a command
    that arrives within a sub-step meets a limit. It is fitted at those that the plant asks for, or at finer ones, where
    these change χ² by what one standard uncertainty does; its residuals are those at these steps. Rugged terms, whose
    laws are less exact than their steps, go no finer than the plant.
    """
    is_rugged = any(term.rugged for term in f.terms)
    for factor in (1.0,) if is_rugged else (1.0, FAR) if f.terms else ():
        if problem.factor < factor:
            finer = replace(problem, factor=factor)
            change = residuals_of(finer, f) - residuals_of(problem, f)
            if is_rugged or change @ change > 1.0:
                problem, f = finer, fit(finer, f, from_here=True)
    return with_known_start(problem, f)


def with_known_start(problem: Problem, f: Fitted) -> Fitted:
    """The same explanation where laws leave much more than noise: fitted with starts known so much better than laws.

    The start of a plant that integrates is uncertain by a little noise. Beside laws that are off by much more, it would
    bend to them for nothing.
    """
    beyond = float(np.sqrt(f.chi2 / problem.size))
    if beyond < SELDOM_BY_CHANCE or all(slope is None for slope in problem.start_slopes) or not f.terms:
        return f
    again = fit(replace(problem, beyond=beyond), f)
    moving = again.chi2 - float(again.residuals @ again.residuals)
    seen = evaluated(problem, again)
    return replace(seen, chi2=seen.chi2 + moving, estimate=again.estimate)


def roughly(problem: Problem, start: Fitted, *, base_free: bool = False) -> Fitted:
    """A first look, which need not creep along a valley to its end."""
    return fit(problem, start, base_free=base_free, effort=ROUGHLY)


def from_other_shapes(problem: Problem, f: Fitted) -> Fitted:
    """The same explanation, every rugged term fitted once more from the shapes of its starts; the lowest of all."""
    for k, term in enumerate(f.terms):
        if term.rugged:
            f = _lowest_valley(problem, f, k)
    return f


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


def _lowest_valley(problem: Problem, f: Fitted, k: int) -> Fitted:
    size = f.values[k][0]
    shapes = dict.fromkeys((size, *shape) for _, *shape in f.terms[k].starts)
    tried = [(*f.values[:k], own, *f.values[k + 1 :]) for own in shapes]

    def chi2(values: tuple[tuple[float, ...], ...]) -> float:
        r = simulated(problem, f.parameters, f.terms, values)
        return float(r @ r)

    nearest = [values for _, values in sorted(zip(spread(chi2, tried), tried, strict=True))[:LEADING]]
    best = min((roughly(problem, replace(f, values=values)) for values in nearest), key=lambda other: other.chi2)
    return min(f, polish(problem, best), key=lambda other: other.chi2) if best.chi2 < f.chi2 else f
