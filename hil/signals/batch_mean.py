"""The mean of readings whose noise may have a colour, and how far it can be off."""

from __future__ import annotations

import math

import numpy as np

from hil.arrays import Array

_PIECES = 10
_FEWEST = 20


def batch_mean(values: Array) -> tuple[float, float | None]:
    """Mean and its standard uncertainty, from the spread of the means of ten pieces; None for fewer than 20 readings.

    Noise that is slower than a piece is not seen. `values` has shape (n,), n ≥ 1.
    """
    mean = float(np.mean(values))
    if len(values) < _FEWEST:
        return mean, None
    means = [float(piece.mean()) for piece in np.array_split(values, _PIECES)]
    return mean, float(np.std(means, ddof=1)) / math.sqrt(_PIECES)
