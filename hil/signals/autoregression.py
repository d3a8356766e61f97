"""Noise with a memory, e_k = −Σ a_i·e_{k−i} + w_k with w white: its filter, and the way there and back.

A whitener is [1, a_1, …, a_p]: it makes the noise white, and its inverse gives white noise the colour.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hil.arrays import Array
from hil.signals.information_criterion import bic
from hil.signals.recursion import filtered

_ORDERS = (1, 2, 4, 8, 16)
_PER_ORDER = 8  # samples for each coefficient
_FORGOTTEN = 200  # samples after which noise does not show how it began


def autocovariance(segments: Sequence[Array], lags: int) -> Array:
    """Of stretches about means of their own, at lags from 0 on, shape (lags + 1,)."""
    total = np.zeros(lags + 1)
    for one in segments:
        centred = one - one.mean()
        total += [float(centred[: len(one) - k] @ centred[k:]) for k in range(lags + 1)]
    return total / max(sum(map(len, segments)), 1)


def yule_walker(covariance: Array, order: int) -> tuple[Array, float]:
    """The whitener of an order by autocovariances at lags from 0 on, and the variance that it leaves."""
    from scipy.linalg import solve_toeplitz

    weights = solve_toeplitz(covariance[:order], covariance[1 : order + 1])
    return np.concatenate(([1.0], -weights)), float(covariance[0] - weights @ covariance[1 : order + 1])


def whitener_of(rest: Array) -> Array:
    """The whitener of a stretch of noise, its order by the Bayesian criterion; [1] where white noise is as good."""
    n = len(rest)
    orders = [order for order in _ORDERS if n >= _PER_ORDER * order]
    best = np.ones(1)
    if not orders or not (covariance := autocovariance([rest], orders[-1]))[0]:
        return best
    score = bic(covariance[0], n, 0)
    for order in orders:
        found, left = yule_walker(covariance, order)
        if (cost := bic(max(left, 1e-12 * covariance[0]), n, order)) < score:
            best, score = found, cost
    return best


def whitened(values: Array, whitener: Array) -> Array:
    """Values, shape (…, n), less what those before them foretell; what was before the first is taken for 0."""
    return values if len(whitener) == 1 else filtered(whitener, (1.0,), values)


def coloured_noise(rng: np.random.Generator, shape: tuple[int, int], whitener: Array) -> Array:
    """Rows of noise, each begun so long before that its start is forgotten, of white noise of unit variance."""
    rows, count = shape
    return coloured(rng.normal(size=(rows, count + _FORGOTTEN)), whitener)[:, _FORGOTTEN:]


def coloured(noise: Array, whitener: Array) -> Array:
    """White noise, shape (…, n), with the colour that a whitener takes away."""
    return noise if len(whitener) == 1 else filtered((1.0,), whitener, noise)
