"""How much of the misfit that can be removed was removed, on recordings that were never handed over."""

from __future__ import annotations

import numpy as np

from ..truth.law import Array

LEAST_GAP_SIGMA = 0.3
"""A nominal model that is closer than this to the truth on unseen recordings leaves no gap worth measuring."""


def fit_percent(measured: Array, simulated: Array) -> float:
    """Return the fit, 100·(1 − ‖y − ŷ‖/‖y − mean(y)‖) %."""
    return float(100.0 * (1.0 - np.linalg.norm(measured - simulated) / np.linalg.norm(measured - measured.mean())))


def misfit_sigma(clean: Array, simulated: Array, noise: float) -> float:
    """Return the rms distance from the noise-free truth, in deviations of the sensor's noise."""
    return float(np.sqrt(np.mean((clean - simulated) ** 2)) / noise)


def gap_closed(nominal: float, corrected: float, truth: float) -> float:
    """Return the share of the gap between two fits that a third one closes; negative if it made things worse."""
    return (corrected - nominal) / (truth - nominal)
