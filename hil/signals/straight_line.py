"""A straight line through weighted values, and how well they tell its slope."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hil.arrays import Array


@dataclass(frozen=True, slots=True)
class Line:
    """The line with the least weighted sum of squares.

    Attributes:
        middle: weighted mean of the abscissae and of the values: the line goes through it.
        slope: value per abscissa.
        spread: weighted sum of squares of the abscissae about their mean.
        residuals: what it leaves of each value, shape (n,).
        variance: of a value of weight one about the line; 1 where the weights are those of the known scatter.
    """

    middle: tuple[float, float]
    slope: float
    spread: float
    residuals: Array
    variance: float

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the variance."""
        return len(self.residuals) - 2

    def slope_std(self, least_variance: float = 0.0) -> float:
        """Standard uncertainty of the slope, by the scatter about the line; of no less than `least_variance`."""
        return math.sqrt(max(least_variance, self.variance) / self.spread)


def weighted_line(at: Array, values: Array, weights: Array | None = None) -> Line:
    """The line through `values` over `at`, all of shape (n,), n ≥ 3 at no less than two places.

    `weights` are inverse variances, known or up to a common factor; all alike where none are given.
    """
    weights = np.ones(len(values)) if weights is None else weights
    middle = (float(np.average(at, weights=weights)), float(np.average(values, weights=weights)))
    about = at - middle[0]
    spread = float(weights @ about**2)
    slope = float(weights @ (about * values)) / spread
    residuals = values - middle[1] - slope * about
    return Line(middle, slope, spread, residuals, float(weights @ residuals**2) / (len(values) - 2))


def chance_beyond(statistic: float, freedom: int) -> float:
    """How likely Student's t is so far from zero, on either side, by chance."""
    from scipy.special import stdtr

    return float(2.0 * stdtr(freedom, -abs(statistic)))
