"""Which of several models to believe: the simplest that predicts what it has not seen as well as the best."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hil.arrays import ROUNDING
from hil.record.recording import Array

VERY_STRONG = 10.0  # difference of BIC from which the evidence against a model is called very strong
EXCLUDED = 0.05  # share of the evidence below which a model is excluded, as an interval of 95 % excludes a value
EXCLUDED_BIC = -2.0 * math.log(EXCLUDED)  # difference of BIC that leaves this share
_NEGLIGIBLE = 0.01


def bic_of_known_noise(chi2: float, count: float, unknowns: float) -> float:
    """`bic` where the noise is known: `chi2` is the sum of squares in units of its variance."""
    return chi2 + unknowns * math.log(count)


def odds(criteria: Sequence[float]) -> Array:
    """How probable each of several models is, of which one is right, by twice its negative log evidence; shape (n,)."""
    from scipy.special import softmax  # a tenth of a second, and most comparisons weigh nothing

    return softmax(-0.5 * np.array(criteria))


def simplest_good(
    errors: Sequence[Array], complexity: Sequence[tuple[float, ...]], standard_errors: float = 1.0
) -> int:
    """Index of the least complex model whose held-out error is as good as the best one's.

    As good is an excess within one standard error, or below one per cent of the error. Errors are compared
    place by place, which takes out what every model finds hard. An excess at one place alone is one standard error.

    Args:
        errors: per model, squared errors at the same held-out places, shape (n,).
        complexity: per model, what to prefer less of, first things first.
        standard_errors: within how many an excess is as good.
    """
    best = min(errors, key=lambda error: float(np.mean(error)))
    good = [i for i, error in enumerate(errors) if _as_good(error, best, standard_errors)]
    return min(good, key=lambda i: complexity[i])


def _as_good(error: Array, best: Array, standard_errors: float) -> bool:
    excess = np.where(np.abs(error - best) > _NEGLIGIBLE * best, error - best, 0.0)
    doubt = float(excess.std(ddof=1)) / math.sqrt(len(excess)) if len(excess) > 1 else math.inf
    return float(excess.mean()) <= max(standard_errors * doubt * (1.0 + ROUNDING), _NEGLIGIBLE * float(best.mean()))
