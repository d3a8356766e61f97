"""How much better a fit must be for each number more that it has: the Bayesian criterion."""

from __future__ import annotations

import math

from hil.arrays import LEAST


def bic(mean_square: float, count: float, unknowns: int) -> float:
    """Schwarz's criterion of a fit to noise of unknown variance; smaller is better.

    Args:
        mean_square: of the residuals, or in any unit that the fits share.
        count: independent samples that they are worth.
        unknowns: how many numbers were fitted.
    """
    return count * math.log(max(mean_square, LEAST)) + unknowns * math.log(count)
