"""Around a point of the search: how residuals move with everything that may adapt, and what one more term changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hil.diagnose.problem import Problem
from hil.diagnose.search.fitted import Fitted, residuals_of, simulated
from hil.diagnose.search.terms import Term
from hil.record.recording import Array

_FROZEN = 1e6


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
        return residuals_of(self.problem, self.accepted, factor=self.problem.coarse_factor)


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
        moved = simulated(problem, accepted.parameters, accepted.terms, values)
        columns.append((moved - accepted.residuals) / step)
    return np.column_stack(columns)


def with_term(place: Around, term: Term, values: Sequence[float], coarse: bool = False) -> Array:
    """Residuals with one more term beside what is accepted."""
    accepted, problem = place.accepted, place.problem
    terms, own = (*accepted.terms, term), (*accepted.values, values)
    if not coarse:
        return simulated(problem, accepted.parameters, terms, own)
    change = simulated(problem, accepted.parameters, terms, own, problem.coarse_factor) - place.coarse_residuals
    return accepted.residuals + change


def adapted_residuals(place: Around, added: tuple[Term, Sequence[float]] | None, *, coarse: bool = False) -> Array:
    """Residuals with one more term, or without, after all else has adapted linearly, shape (n + base,)."""
    if added is None:
        return adapt(place, place.accepted.residuals, None)[0]
    return adapt(place, with_term(place, *added, coarse), added[0])[0]


def adapt(place: Around, r: Array, term: Term | None) -> tuple[Array, Array]:
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
