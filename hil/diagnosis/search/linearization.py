"""A point of the search, linearised: how residuals move with all that may adapt, and what one more term changes."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.search.fitted import Fitted, residuals_of, simulated
from hil.diagnosis.search.terms import Term
from hil.diagnosis.thresholds import TINY
from hil.identification.grey_box.estimate import jacobian
from hil.record.recording import Array

_FROZEN = 1e6


@dataclass(frozen=True, slots=True)
class _Adaptation:
    """How everything that may adapt does so, linearly.

    Attributes:
        prior: what moving costs, rows (base, columns) of a root of the prior's precision; `cost`: of where it is now.
        moves: of unit slopes of the misfit, shape (columns, columns).
    """

    prior: Array
    cost: Array
    moves: Array


@dataclass(frozen=True)
class Linearization:
    """A point of the search: what is accepted, and how residuals move with everything that may adapt."""

    problem: Problem
    accepted: Fitted
    slopes: Array  # (n, base + accepted unknowns)

    @cached_property
    def gram(self) -> Array:
        """Inner products of the slopes, shape (k, k)."""
        return self.slopes.T @ self.slopes

    @cached_property
    def adaptations(self) -> dict[frozenset[str], _Adaptation]:
        """Those worked out so far, by the names that do not adapt."""
        return {}

    @cached_property
    def residuals_without(self) -> Array:
        """With no term more, after all that may adapt has adapted linearly."""
        return adapt(self, self.accepted.residuals, None)[0]

    @cached_property
    def coarse_residuals(self) -> Array:
        """Of what is accepted, with coarser sub-steps."""
        return residuals_of(self.problem, self.accepted, factor=self.problem.coarse_factor)


def linearized(problem: Problem, accepted: Fitted) -> Linearization:
    """Linearise around what is accepted so far."""
    effects = [*problem.model.active_effects, *accepted.effects]
    base = problem.base_jacobian(accepted.parameters, effects, accepted.residuals)
    own = [_term_slopes(problem, accepted, k) for k in range(len(accepted.terms))]
    return Linearization(problem, accepted, np.vstack([base.T, *own]).T)


def _term_slopes(problem: Problem, accepted: Fitted, k: int) -> Array:
    """Shape (unknowns of the term, n)."""

    def moved(own: Array) -> Array:
        values = (*accepted.values[:k], tuple(own.tolist()), *accepted.values[k + 1 :])
        return simulated(problem, accepted.parameters, accepted.terms, values)

    return jacobian(moved, accepted.terms[k].unknowns, np.array(accepted.values[k]), accepted.residuals).T


def with_term(linear: Linearization, term: Term, values: Sequence[float]) -> Array:
    """Residuals with one more term beside what is accepted; its change is simulated in coarse sub-steps."""
    accepted, problem = linear.accepted, linear.problem
    terms, own = (*accepted.terms, term), (*accepted.values, values)
    change = simulated(problem, accepted.parameters, terms, own, problem.coarse_factor) - linear.coarse_residuals
    return accepted.residuals + change


def adapted_residuals(linear: Linearization, term: Term, values: Sequence[float]) -> Array:
    """Residuals with one more term after all else has adapted linearly, shape (n + base,)."""
    return adapt(linear, with_term(linear, term, values), term)[0]


def adapt(linear: Linearization, r: Array, term: Term | None) -> tuple[Array, Array]:
    """Residuals after everything but `term` has adapted linearly, with the cost of it appended; the moves."""
    named = {t.name for t in linear.accepted.terms if t.kind == "parameter"} | ({term.name} if term else set())
    taken = frozenset(named.intersection(p.name for p in linear.problem.base))
    known = linear.adaptations.get(taken)
    if known is None:
        known = linear.adaptations[taken] = _adaptation(linear, taken)
    moves = known.moves @ (linear.slopes.T @ r + known.prior.T @ known.cost)
    return np.concatenate([r + linear.slopes @ moves, known.cost + known.prior @ moves]), moves


def _adaptation(linear: Linearization, taken: Collection[str]) -> _Adaptation:
    """Base parameters that are terms do not adapt; an effect stands for the base parameter of its name."""
    problem, accepted = linear.problem, linear.accepted
    free = [k for k, p in enumerate(problem.base) if p.name not in taken]
    prior = np.zeros((len(problem.base), linear.slopes.shape[1]))
    prior[np.ix_(free, free)] = problem.prior.root(free)
    away = np.zeros(linear.slopes.shape[1])
    for k, p in enumerate(problem.base):
        if p.name in taken:
            prior[k, k] = _FROZEN / problem.prior.std[k]
        else:
            away[k] = accepted.parameters[p.name] - problem.model.values[p.name]
    information = linear.gram + prior.T @ prior
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), TINY))
    scales = np.outer(scale, scale)
    return _Adaptation(prior, prior @ away, -scales * np.linalg.pinv(information * scales, rcond=1e-12, hermitian=True))
