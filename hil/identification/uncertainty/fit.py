"""How well a simulation fits what was measured, in per cent."""

from __future__ import annotations

import numpy as np

from hil.record.recording import Array


def fit_percent(measured: Array, simulated: Array) -> float:
    """100·(1 − ‖y − ŷ‖/‖y − mean(y)‖) %, as the papers use it."""
    spread = float(np.linalg.norm(measured - measured.mean()))
    if spread == 0.0:
        return float("nan")
    return 100.0 * (1.0 - float(np.linalg.norm(measured - simulated)) / spread)


def fit_ceiling(measured: Array, noise_std: float) -> float:
    """The fit that the true model would reach, given the noise."""
    return 100.0 * (1.0 - noise_std / float(np.std(measured))) if np.std(measured) else float("nan")
