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
from hil.identification.steady.characteristic import Loop, loop
from hil.identification.steady.sweep_estimate import Sweep, SweepEstimate, sweep_estimate
from hil.identification.uncertainty.parametric_bootstrap import DRAWS, about
from hil.record.recording import Array
from hil.signals.crossing import first_crossing
from hil.signals.interval import CERTAIN


@dataclass(frozen=True, slots=True)
class PressureCurve:
    """The curve and what was read from it.

    Attributes:
        estimate: the smooth curve that the sweeps share.
        loop: what lies between the branches.
        rising, falling: branches at the levels of the estimate, lag taken out, shape (levels,).
    """

    estimate: SweepEstimate
    loop: Loop
    rising: Array
    falling: Array

    @property
    def current(self) -> Array:
        """Levels, rising, from the lowest current to the highest."""
        return self.estimate.command

    @property
    def nominal(self) -> Array:
        """Pressure at the levels, between the branches."""
        return self.estimate.response

    @property
    def std(self) -> Array:
        """Standard uncertainty of the pressure at the levels, of the noise alone."""
        return np.std(self.estimate.responses, axis=0)

    @property
    def span(self) -> float:
        """Change of pressure from the lowest to the highest current; negative for a valve that current closes."""
        return float(self.nominal[-1] - self.nominal[0])

    @property
    def span_std(self) -> float:
        """Standard uncertainty of the span, of the noise alone."""
        resampled = self.estimate.responses[:, -1] - self.estimate.responses[:, 0]
        return about(resampled, self.span)

    def current_at(self, pressure: float) -> float:
        """Current at which the nominal curve passes a pressure.

        Raises:
            InputError: it does not.
        """
        sign = math.copysign(1.0, self.span)
        monotone = np.maximum.accumulate(sign * self.nominal)
        found = first_crossing(self.current, monotone, sign * pressure)
        if found is None or sign * pressure < monotone[0]:
            low, high = sorted((float(self.nominal[0]), float(self.nominal[-1])))
            raise InputError(f"pressure {pressure:g} psi: the curve goes from {low:.4g} to {high:.4g} psi")
        return found


def pressure_curve(name: str, sweeps: Sequence[Sweep], draws: int = DRAWS) -> PressureCurve:
    """The curve of the sweeps; their speeds tell lag from hysteresis.

    Args:
        name: of the recording, for messages.
        sweeps: at two speeds.
        draws: how often it is resampled for its uncertainty.

    Raises:
        InputError: fewer than two sweeps, all of one speed, or a current that does not go up and down.
    """
    speeds = tuple(sweep.speed_per_s for sweep in sweeps)
    if len(sweeps) < 2 or np.ptp(speeds) == 0.0:
        raise InputError(f"{name}: a pressure curve needs sweeps at two speeds")
    estimate = sweep_estimate(name, sweeps, draws=draws)
    return PressureCurve(
        estimate, loop(estimate, CERTAIN, speeds), estimate.completed_branch(1), estimate.completed_branch(-1)
    )
