"""Fit a set of terms: one more given that all else is linear, or everything together with nothing linearised."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.search.effort import EFFORT, Steps
from hil.diagnosis.search.fitted import Fitted, evaluated, residuals_of, simulated, starting
from hil.diagnosis.search.linearization import Linearization, adapt, with_term
from hil.diagnosis.search.terms import Term
from hil.diagnosis.thresholds import FAR, SELDOM_BY_CHANCE
from hil.identification.grey_box.estimate import Unknown, estimate
from hil.record.recording import Array, Mask


def fit_given(linear: Linearization, term: Term, start: tuple[float, ...]) -> Fitted:
    """One term from a start, everything else adapting linearly, in coarse sub-steps."""
    moves_at: dict[tuple[float, ...], Array] = {}

    def residuals(values: Array) -> Array:
        own = tuple(values.tolist())
        adapted, moves_at[own] = adapt(linear, with_term(linear, term, own), term)
        return adapted

    steps = EFFORT.linear
    unknowns = starting(term.unknowns, start)
    found = estimate(residuals, unknowns, max_evaluations=steps.evaluations, tolerance=steps.tolerance)
    values = tuple(found.values.tolist())
    moves = moves_at[values]
    return _moved(linear, (*linear.accepted.terms, term), values, moves, found.chi2)


def _moved(
    linear: Linearization, terms: tuple[Term, ...], last: tuple[float, ...], moves: Array, chi2: float
) -> Fitted:
    """The point that the linear moves lead to; its residuals are those before them."""
    accepted, base = linear.accepted, linear.problem.base
    parameters = dict(accepted.parameters)
    for p, move in zip(base, moves, strict=False):
        parameters[p.name] = float(np.clip(parameters[p.name] + move, p.low, p.high))
    values, at = [], len(base)
    for term, own in accepted.pairs:
        bounded = zip(own, moves[at : at + len(own)], term.unknowns, strict=True)
        values.append(tuple(float(np.clip(v + m, u.low, u.high)) for v, m, u in bounded))
        at += len(own)
    return Fitted(terms, (*values, last), parameters, chi2, accepted.residuals)


def fit(
    problem: Problem,
    fitted: Fitted,
    *,
    base_free: bool = False,
    keep: Mask | None = None,
    steps: Steps = EFFORT.end,
    from_here: bool = False,
) -> Fitted:
    """Fit terms and base parameters together from one start, nothing linearised.

    Args:
        problem: the question.
        fitted: terms and where to start.
        base_free: let base parameters go as far as they like instead of as far as their prior lets them.
        keep: which residuals count, shape (n,); the others are for judging.
        steps: how far to go.
        from_here: start with base parameters as they are, even where their nominal values would be a better start.
    """
    taken = {term.name for term in fitted.terms if term.kind == "parameter"}
    free = [k for k, p in enumerate(problem.base) if p.name not in taken]
    base = [problem.base[k] for k in free]
    root = problem.prior.root(free)
    nominal = np.array([problem.model.values[p.name] for p in base])
    unknowns = [Unknown(p.name, p.unit, fitted.parameters[p.name], p.low, p.high, p.scale) for p in base]
    for term, values in fitted.pairs:
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
        max_evaluations=steps.evaluations,
        tolerance=steps.tolerance,
    )
    parameters, own = split(found.values)
    of_prior = 0 if base_free else len(root)
    r = found.residuals[: len(found.residuals) - of_prior]
    if keep is not None:
        r = simulated(problem, parameters, fitted.terms, own)
    for term, values in zip(fitted.terms, own, strict=True):
        if term.kind == "parameter":
            parameters[term.name] = values[0]
    return Fitted(fitted.terms, tuple(own), parameters, found.chi2, r, found)


def finished(problem: Problem, f: Fitted) -> Fitted:
    """Refits with tight tolerances.

    Sub-steps whose error is next to nothing for a verdict may still move a value by its uncertainty, as where a command
    that arrives within a sub-step meets a limit. It is fitted at those that the plant asks for, or at finer ones, where
    these change χ² by what one standard uncertainty does; its residuals are those at these steps. Rugged terms, whose
    laws are less exact than their steps, go finer than the plant only where less is left there.
    """
    if not f.terms:
        return f
    f = fit(problem, f, from_here=True)
    is_multimodal = any(term.multimodal for term in f.terms)
    for factor in (1.0, FAR):
        if problem.factor < factor:
            finer = replace(problem, factor=factor)
            change = residuals_of(finer, f) - f.residuals
            if (is_multimodal and factor == 1.0) or change @ change > 1.0:
                again = fit(finer, f, from_here=True)
                if not (is_multimodal and factor > 1.0 and again.chi2 > f.chi2):
                    problem, f = finer, again
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
