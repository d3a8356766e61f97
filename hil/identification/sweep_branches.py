"""A sweep up and down, averaged per level of the command, rising and falling apart."""

from __future__ import annotations

import numpy as np

from hil.errors import InputError
from hil.record.recording import Array

_BINS = 120
_LEAST_PER_BIN = 3


def branches(name: str, command: Array, output: Array) -> tuple[Array, Array, Array, Array]:
    """Levels, means of the rising and the falling branch there, and the standard uncertainty of their mean.

    Levels that only one branch has are dropped; every array has shape (levels,).

    Raises:
        InputError: the command does not go both up and down over one range.
    """
    low, high = float(command.min()), float(command.max())
    if high <= low:
        raise InputError(f"{name}: the command does not move; a flow curve needs a sweep")
    slope = np.gradient(command)
    up, down = (_binned(command[m], output[m], low, high) for m in (slope > 0.0, slope < 0.0))
    both = np.isfinite(up[1]) & np.isfinite(down[1])
    if both.sum() < _BINS // 4:
        raise InputError(f"{name}: the command does not sweep both up and down over one range")
    levels = (up[0] + down[0])[both] / 2.0
    rising, falling = (np.interp(levels, branch[0][both], branch[1][both]) for branch in (up, down))
    return levels, rising, falling, np.sqrt((up[2] + down[2])[both]) / 2.0


def _binned(command: Array, output: Array, low: float, high: float) -> tuple[Array, Array, Array]:
    """Mean command, mean output and the variance of that mean per bin; NaN where a bin holds too few samples."""
    width = (high - low) / _BINS
    bins = np.clip(((command - low) / width).astype(np.int64), 0, _BINS - 1)
    count = np.bincount(bins, minlength=_BINS).astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        place = np.bincount(bins, command, _BINS) / count
        mean = np.bincount(bins, output, _BINS) / count
        # Within a bin the curve has a slope; what departs from that slope is noise.
        along = np.bincount(bins, (command - place[bins]) ** 2, _BINS)
        tilt = np.bincount(bins, (command - place[bins]) * (output - mean[bins]), _BINS) / along
        rest = output - mean[bins] - tilt[bins] * (command - place[bins])
        variance = np.bincount(bins, rest**2, _BINS) / (count - 2.0) / count
    enough = count >= _LEAST_PER_BIN
    return np.where(enough, place, np.nan), np.where(enough, mean, np.nan), np.where(enough, variance, np.nan)
