"""Ratios of amplitudes in decibels."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from hil.arrays import Array

_PER_DECADE = 20.0
PER_NEPER = _PER_DECADE / math.log(10.0)
"""Decibels of a change of a natural logarithm by one."""


def decibels(ratio: ArrayLike) -> Array:
    """20·lg of the size of ratios, real or complex."""
    return _PER_DECADE * np.log10(np.abs(ratio))


def of_decibels(decibels: ArrayLike) -> Array:
    """Ratios from decibels."""
    return 10.0 ** (np.asarray(decibels) / _PER_DECADE)
