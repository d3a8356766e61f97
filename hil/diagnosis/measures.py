"""What an explanation is worth: what it leaves, what it costs, and whether what it says is there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hil.diagnosis.problem import Problem
from hil.diagnosis.search.fitted import Fitted
from hil.diagnosis.search.terms import Term
from hil.diagnosis.yardsticks import CERTAIN
from hil.identification.estimate import Unknown
from hil.identification.evidence import VERY_STRONG, bic_of_known_noise

# A misfit below this share of the noise variance is of no practical size.
SMALL_EXCESS = 0.03
# What is consistent leaves less than this.
CONSISTENT_EXCESS = 2.0 * SMALL_EXCESS
# Laws of nature are not the laws of the library: an explanation may leave this share of the misfit, …
LAW_TOLERANCE = 0.04
# … where it is told as part of the truth this share, as another name for it would have to look much the same, or this
# one, where every other name leaves plainly more, …
NEARLY_ALL, PART_TOLERANCE = 0.12, 0.25
# … and this share (rms) of the swing of the output, …
OUTPUT_TOLERANCE = 0.05
# … below this share, and the noise's own variance, nobody looks for a second cause.
FULL_TOLERANCE = 0.003
_INSIDE_SIGMAS = 2.0
# An unknown costs so many times what it would if the laws of the library were those of nature (Schwarz: ln n).
_PRICE = 2.0


def excess(problem: Problem, chi2: float) -> float:
    """Variance beyond the noise, as a share of it."""
    return max(chi2 / problem.size - 1.0, 0.0)


def share_left(problem: Problem, chi2: float, beyond: float) -> float:
    """The share that an explanation leaves of a misfit, given as variance beyond the noise."""
    return excess(problem, chi2) / max(beyond, SMALL_EXCESS)


@dataclass(frozen=True)
class Measures:
    """Measures of explanations of one problem.

    Attributes:
        problem: the question.
        baseline: the nominal model, base parameters moved within their prior; what it leaves is the misfit.
    """

    problem: Problem
    baseline: Fitted

    @cached_property
    def swing(self) -> float:
        """Sum of squares of the outputs about their means, in units of the noise variance."""
        outputs = zip(self.problem.experiments, self.problem.noises, strict=True)
        return sum(float(np.sum((e.output - e.output.mean()) ** 2)) / noise.std**2 for e, noise in outputs)

    def excess(self, f: Fitted) -> float:
        """Variance that an explanation leaves beyond the noise, as a share of it."""
        return excess(self.problem, f.chi2)

    def left(self, f: Fitted) -> float:
        """The share of the misfit that an explanation leaves."""
        return share_left(self.problem, f.chi2, self.excess(self.baseline))

    def cost(self, f: Fitted) -> float:
        """χ² and the price of unknowns; for physics that the nominal model lacks evidence must be very strong."""
        added = sum(term.is_new for term in f.terms)
        return bic_of_known_noise(f.chi2, self.problem.size, _PRICE * f.unknowns) + added * VERY_STRONG

    def burden(self, f: Fitted) -> float:
        """Variance that an explanation leaves beyond the noise, and what it costs, as a share of it."""
        return excess(self.problem, self.cost(f))

    def gain(self, seed: Fitted, chi2: float) -> float:
        """The share of what an explanation leaves that another χ² would take away."""
        return (seed.chi2 - chi2) / max(self.excess(seed) * self.problem.size, 1e-12)

    def is_full(self, f: Fitted) -> bool:
        """Whether an explanation leaves nothing that a second cause could be sought in."""
        if self.excess(f) <= SMALL_EXCESS:
            return True
        beyond = max(self.excess(f), self._excess_of_output(f))  # inner signals with much noise would hide it
        return beyond <= 1.0 and self.left(f) <= FULL_TOLERANCE

    def is_all(self, f: Fitted) -> bool:
        """Whether an explanation leaves nothing to look for, and is what its names say."""
        return self.is_full(f) and are_themselves(f)

    def _excess_of_output(self, f: Fitted) -> float:
        """Variance that an explanation leaves beyond the noise of the output alone, as a share of it."""
        outputs = np.concatenate(self.problem.outputs_of(f.residuals))
        return float(np.mean(outputs**2)) - 1.0

    def left_of_output(self, f: Fitted) -> float:
        """The share of the outputs' variance that an explanation leaves beyond the noise."""
        return self.excess(f) * self.problem.size / self.swing

    def is_adequate(self, f: Fitted) -> bool:
        """Whether an explanation leaves little of the misfit and, where that is most of the output, little of that."""
        of_output = self.left_of_output(f)
        return self.excess(f) <= SMALL_EXCESS or (self.left(f) <= LAW_TOLERANCE and of_output <= OUTPUT_TOLERANCE**2)


def is_present(f: Fitted) -> bool:
    """Whether every effect is really there: its sizes together differ from their nulls beyond doubt (Wald)."""
    return all(is_there(f, term) for term in f.terms)


def is_there(f: Fitted, term: Term) -> bool:
    """The same of one of its effects; a limit is there wherever it is."""
    if not term.scales or f.estimate is None:
        return True
    first = f.estimate_index(term)
    sizes = [first + k for k in term.sizes]
    shapes = [first + k for k in range(len(term.unknowns)) if k not in term.sizes]
    away = f.estimate.values[sizes] - [term.nulls[k] for k in term.sizes]
    return not f.estimate.sigmas_away(sizes, away, held=shapes) < CERTAIN  # how large it is, not which shape


def is_itself(f: Fitted, term: Term) -> bool:
    """Whether the shapes that tell an effect from others are beyond doubt inside their range."""
    if f.estimate is None:
        return True
    first, telling = f.estimate_index(term), dict(term.telling)
    return all(
        _room(u, float(f.estimate.values[k]), telling[u.name]) > _INSIDE_SIGMAS * f.estimate.std[k]
        for k, u in enumerate(term.unknowns, first)
        if u.name in telling
    )


def are_themselves(f: Fitted) -> bool:
    """Whether every effect has the shape that tells it from others."""
    return all(is_itself(f, term) for term in f.terms)


def _room(u: Unknown, value: float, telling: str) -> float:
    """How far a shape is from where it would be that of another effect."""
    return u.high - value if telling == "upper end" else min(value - u.low, u.high - value)


def is_strained(f: Fitted) -> bool:
    """Whether a shape had to go to the end of what is physical, where that is not simply its absence."""
    return any(
        k > 0 and value != 0.0 and u.at_bound(value)
        for term, own in zip(f.terms, f.values, strict=True)
        for k, (value, u) in enumerate(zip(own, term.unknowns, strict=True))
    )
