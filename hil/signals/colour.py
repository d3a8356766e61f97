"""How much louder a residual is at one frequency than white noise of the same power would be."""

from __future__ import annotations

import math

import numpy as np

from hil.arrays import Array
from hil.signals.products import rows_by_rows

_REACH = 200


def colour_factor(residuals: Array, reach: int = _REACH) -> float:
    """How many neighbouring samples say the same: the variance of a mean over that of white noise, ≥ 1."""
    return float(colour_factors(residuals, np.zeros(1), reach)[0])


def noisy_mean(values: Array) -> tuple[float, float]:
    """Mean of what stands, and its standard uncertainty by noise of any colour."""
    return float(values.mean()), float(values.std()) * math.sqrt(colour_factor(values) / len(values))


def colour_factors(residuals: Array, cycles_per_sample: Array, reach: int = _REACH) -> Array:
    """Noise density at given frequencies over its mean, never below 1: factors on variances estimated there.

    Half-overlapping blocks are averaged (Bartlett's method), so features narrower than 1/`reach` of the
    sample rate are smeared.

    Args:
        residuals: what a fit left over, shape (n,), taken as evenly sampled.
        cycles_per_sample: where the density is wanted, 0…0.5, shape (m,).
        reach: samples in a block; fewer when eight blocks would not fit.
    """
    n = len(residuals)
    block = min(reach, n // 8)
    centred = residuals - residuals.mean()
    power = float(np.mean(centred**2))
    if block < 2 or power == 0.0:
        return np.ones(len(cycles_per_sample))
    turn = 2.0 * math.pi * np.outer(cycles_per_sample, np.arange(block))
    table = np.concatenate((np.cos(turn), np.sin(turn)))
    found = np.concatenate([rows_by_rows(part, table) for part in _halves(centred, block)])
    density = np.mean(found**2, axis=0).reshape(2, -1).sum(axis=0) / (block * power)
    return np.maximum(1.0, density)


def _halves(values: Array, block: int) -> list[Array]:
    """The values cut into blocks twice, the second time half a block later."""
    cut = [values[first:] for first in (0, block // 2)]
    return [part[: len(part) // block * block].reshape(-1, block) for part in cut]
