"""How well a simulation fits what was measured, in per cent."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hil.record.recording import Array, Complex
from hil.signals.decibel import decibels


def fit_percent(measured: Array | Complex, simulated: Array | Complex) -> float:
    """100·(1 − ‖y − ŷ‖/‖y − mean(y)‖) %, as the papers use it; of complex responses as MATLAB's `compare` gives it."""
    spread = float(np.linalg.norm(measured - measured.mean()))
    return 100.0 * (1.0 - float(np.linalg.norm(measured - simulated)) / spread) if spread else math.nan


def explains_little(measured: Sequence[Array], errors: Sequence[Array]) -> bool:
    """Whether more than half of the variance of what was measured is left; what left it began in the wrong place.

    Args:
        measured: of each recording, shape (n,).
        errors: simulated − measured, in the same unit, however they are parted.
    """
    whole = sum(float(np.sum((one - one.mean()) ** 2)) for one in measured)
    return 2.0 * sum(float(one @ one) for one in errors) > whole


def rms(values: Array) -> float:
    """Root mean square; 0 of nothing."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def bode_errors(measured: Complex, modelled: Complex) -> tuple[float, float]:
    """Rms errors of a frequency response in dB and in degrees."""
    ratio = modelled / measured
    return rms(decibels(ratio)), rms(np.degrees(np.angle(ratio)))


def fit_ceiling(measured: Array, noise_std: float) -> float:
    """The fit that the true model would reach, given the noise."""
    return 100.0 * (1.0 - noise_std / float(np.std(measured))) if np.std(measured) else math.nan
