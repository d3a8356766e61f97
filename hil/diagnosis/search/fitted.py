"""Explanations with values: terms, base parameters, and what they leave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.search.terms import Term
from hil.identification.grey_box.estimate import Estimate, Unknown
from hil.identification.preparation.experiment import Experiment
from hil.physics.simulate import ActiveEffect
from hil.record.recording import Array


@dataclass(frozen=True, slots=True)
class Fitted:
    """Terms with values.

    Attributes:
        terms, values: what was fitted, one tuple of values for each term.
        parameters: every base parameter, moved as far as its prior lets it.
        chi2: sum of squared residuals, the cost of moving base parameters included.
        residuals: whitened, shape (n,).
        estimate: of terms and base parameters together; None before a fit.
    """

    terms: tuple[Term, ...]
    values: tuple[tuple[float, ...], ...]
    parameters: dict[str, float]
    chi2: float
    residuals: Array
    estimate: Estimate | None = None

    @property
    def pairs(self) -> list[tuple[Term, tuple[float, ...]]]:
        """Each term with its values."""
        return list(zip(self.terms, self.values, strict=True))

    @property
    def unknowns(self) -> int:
        """Number of estimated values."""
        return sum(len(term.unknowns) for term in self.terms)

    @property
    def effects(self) -> list[ActiveEffect]:
        """The effects among the terms, as the simulation takes them."""
        found: list[ActiveEffect] = []
        for term, values in self.pairs:
            term.apply(values, {}, found)
        return found

    @property
    def names(self) -> tuple[str, ...]:
        """The effects that the terms stand for; changed parameters have none."""
        named = (term.effect_name(values) for term, values in self.pairs)
        return tuple(name for name in named if name)

    def only(self, keep: Sequence[int]) -> Fitted:
        """Some of the terms, as they are; base parameters that were the others go back. χ² and residuals stay."""
        back = {t.name: t.nominal for k, t in enumerate(self.terms) if t.kind == "parameter" and k not in keep}
        terms, values = tuple(self.terms[k] for k in keep), tuple(self.values[k] for k in keep)
        return replace(self, terms=terms, values=values, parameters=self.parameters | back, estimate=None)

    def without(self, k: int) -> Fitted:
        """All but one of the terms, as in `only`."""
        return self.only([i for i in range(len(self.terms)) if i != k])

    @property
    def as_change(self) -> Fitted:
        """The same with base parameters reported as such, and not as the effects that they grow into."""
        plain = (replace(t, growth="", change="") if t.kind == "parameter" else t for t in self.terms)
        return replace(self, terms=tuple(plain))

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
        """Unknowns of the terms that ended on a bound of theirs which is no natural end."""
        return tuple(
            f"{term.name}.{u.name}"
            for term, values in self.pairs
            for u, value in zip(term.unknowns, values, strict=True)
            if u.at_bound(value) and not u.at_natural_end(value)
        )


def nothing(problem: Problem) -> Fitted:
    """No term: the nominal model."""
    r = problem.nominal_residuals
    return Fitted((), (), dict(problem.model.values), float(r @ r), r)


def evaluated(problem: Problem, f: Fitted) -> Fitted:
    """An explanation as it stands, with what it leaves of the recordings of a problem."""
    r = residuals_of(problem, f)
    return replace(f, chi2=float(r @ r), residuals=r)


def output_of(problem: Problem, f: Fitted, e: Experiment) -> Array:
    """The output that an explanation as it stands gives under what drives an experiment, shape (n,)."""
    return rows_of(problem, f, e)[0]


def rows_of(problem: Problem, f: Fitted, e: Experiment) -> Array:
    """The output and the plant's inner signals, as in `output_of`, shape (1 + observed, n)."""
    effects = [*problem.model.active_effects, *f.effects]
    return e.respond(problem.plant, f.parameters, effects, factor=problem.factor)


def residuals_of(
    problem: Problem, f: Fitted, *, factor: float | None = None, experiments: Sequence[Experiment] | None = None
) -> Array:
    """Whitened residuals of an explanation as it stands, shape (n,); the rest as in `Problem.residuals`."""
    return simulated(problem, f.parameters, f.terms, f.values, factor, experiments)


def change_without(problem: Problem, f: Fitted, k: int) -> Array:
    """How residuals change when one term is taken away, shape (n,)."""
    return residuals_of(problem, f.without(k)) - f.residuals


def simulated(
    problem: Problem,
    parameters: dict[str, float],
    terms: Sequence[Term],
    values: Sequence[Sequence[float]],
    factor: float | None = None,
    experiments: Sequence[Experiment] | None = None,
) -> Array:
    """Whitened residuals of terms at values, beside base parameters; the rest as in `Problem.residuals`."""
    moved, effects = dict(parameters), list(problem.model.active_effects)
    for term, own in zip(terms, values, strict=True):
        term.apply(own, moved, effects)
    return problem.residuals(moved, effects, factor=factor, experiments=experiments)


def starting(unknowns: Sequence[Unknown], start: Sequence[float]) -> list[Unknown]:
    """The same unknowns, to be estimated from other starts."""
    return [Unknown(u.name, u.unit, s, u.low, u.high, u.scale) for u, s in zip(unknowns, start, strict=True)]
