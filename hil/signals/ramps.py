"""Slow sweeps: ramps and triangles for steady-state curves."""

from __future__ import annotations

import numpy as np

from hil.arrays import Array
from hil.errors import SettingError


def ramp(start: float, stop: float, duration_s: float, rate_hz: float) -> Array:
    """A straight line from start to stop, both included.

    Raises:
        SettingError: the duration is shorter than one sample.
    """
    samples = round(duration_s * rate_hz)
    if samples < 1:
        raise SettingError(f"ramp of {duration_s:g} s has no sample at {rate_hz:g} Hz")
    return np.linspace(start, stop, samples + 1)


def triangle(low: float, high: float, cycle_s: float, rate_hz: float, cycles: int = 1, start: float = 0.0) -> Array:
    """From start → high → low → start, `cycles` times, at one constant rate of change.

    A cycle covers the whole loop once up and once down, so that hysteresis can be read at every level.

    Raises:
        SettingError: start is not within low…high, or the cycle has no samples.
    """
    if not low <= start <= high or low == high:
        raise SettingError(f"triangle from {start:g} between {low:g} and {high:g}: the start must lie between them")
    corners = np.array([start, high, low, start])
    path = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(corners)))))
    samples = round(cycle_s * rate_hz)
    if samples < 4:
        raise SettingError(f"triangle of {cycle_s:g} s has {samples} samples at {rate_hz:g} Hz; 4 are needed")
    one = np.interp(np.arange(samples) / samples * path[-1], path, corners)
    return np.concatenate((np.tile(one, cycles), [start]))
