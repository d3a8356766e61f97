"""A pressure curve from sweeps of the current up and down at two speeds: what is hysteresis, and what is lag.

The branches lie apart by w = w₀ + 2τ·speed along the current: Coulomb friction F makes w₀ = 2F at any speed, a lag τ
the rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil.errors import InputError
from hil.identification.sweep_branches import branches
from hil.record.recording import Array


@dataclass(frozen=True, slots=True)
class Sweep:
    """Current, in A, and pressure over one sweep up and down, each of shape (n,), at a speed in A/s."""

    current: Array
    pressure: Array
    speed_per_s: float


@dataclass(frozen=True, slots=True)
class PressureCurve:
    """The curve and what was read from it; branches without the lag's part of their distance.

    Attributes:
        current: levels, rising, shape (n,). `rising`, `falling`, `std`: pressures there.
        hysteresis_a, hysteresis_std_a: width of the loop along the current that no speed explains.
        lag_s, lag_std_s: what widens it with speed.
    """

    current: Array
    rising: Array
    falling: Array
    std: Array
    hysteresis_a: float
    hysteresis_std_a: float
    lag_s: float
    lag_std_s: float

    @property
    def nominal(self) -> Array:
        """Middle of the branches."""
        made: Array = (self.rising + self.falling) / 2.0
        return made

    @property
    def span(self) -> float:
        """Change of pressure from the lowest to the highest current; negative for a valve that current closes."""
        ends = max(1, len(self.current) // 20)
        return float(self.nominal[-ends:].mean() - self.nominal[:ends].mean())

    @property
    def span_std(self) -> float:
        """Standard uncertainty of the span, of the noise alone."""
        return math.sqrt(2.0) * float(np.median(self.std))

    def pressure_at(self, current: float) -> float:
        """Nominal pressure at a current."""
        return float(np.interp(current, self.current, self.nominal))

    def current_at(self, pressure: float) -> float:
        """Current at which the nominal curve passes a pressure.

        Raises:
            InputError: it does not.
        """
        rising = self.nominal if self.span > 0.0 else -self.nominal
        monotone = np.maximum.accumulate(rising)
        wanted = pressure if self.span > 0.0 else -pressure
        if not monotone[0] <= wanted <= monotone[-1]:
            low, high = sorted((float(self.nominal[0]), float(self.nominal[-1])))
            raise InputError(f"pressure {pressure:g} psi: the curve goes from {low:.4g} to {high:.4g} psi")
        i = max(int(np.argmax(monotone >= wanted)), 1)
        share = (wanted - monotone[i - 1]) / (monotone[i] - monotone[i - 1])
        return float(self.current[i - 1] + share * (self.current[i] - self.current[i - 1]))


def pressure_curve(name: str, sweeps: Sequence[Sweep]) -> PressureCurve:
    """The curve of the first sweep; the others tell lag from hysteresis by their speed.

    Raises:
        InputError: fewer than two sweeps, all of one speed, or a current that does not go up and down.
    """
    speeds = np.array([sweep.speed_per_s for sweep in sweeps])
    if len(sweeps) < 2 or np.ptp(speeds) == 0.0:
        raise InputError(f"{name}: a pressure curve needs sweeps at two speeds")
    curves = [branches(name, sweep.current, sweep.pressure) for sweep in sweeps]
    widths, stds = np.array([_width(*curve) for curve in curves]).T
    # w = w₀ + 2τ·speed, weighted by what each width is known to
    weights = 1.0 / np.maximum(stds, 1e-9)
    columns = np.column_stack((np.ones(len(speeds)), 2.0 * speeds)) * weights[:, None]
    covariance = np.linalg.inv(columns.T @ columns)
    width, lag_s = covariance @ columns.T @ (weights * widths)
    current, rising, falling, std = curves[0]
    shift = float(lag_s) * float(speeds[0])
    return PressureCurve(
        current, np.interp(current, current - shift, rising), np.interp(current, current + shift, falling), std,
        float(width), math.sqrt(covariance[0, 0]), float(lag_s), math.sqrt(covariance[1, 1]),
    )  # fmt: skip


def _width(levels: Array, rising: Array, falling: Array, std: Array) -> tuple[float, float]:
    """Shift of the branches along the current that explains their distance best, and its standard uncertainty."""
    slope = np.gradient((rising + falling) / 2.0, levels)
    weight = float(slope @ slope)
    if weight == 0.0:
        return 0.0, math.inf
    return float((falling - rising) @ slope) / weight, 2.0 * math.sqrt(float((std * slope) @ (std * slope))) / weight
