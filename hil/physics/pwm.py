"""A coil behind a PWM power stage: ripple, duty, dither, and the current loop that drives it, switch by switch.

While the switch is on, the supply drives the coil; while it is off, the current flows on through a diode. Both stages
are solved exactly, so nothing depends on a step size. The mean voltage never exceeds 133 % of the coil's nominal one,
the proof voltage of the EFC thesis, whatever the supply is.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from hil.errors import InputError
from hil.kernel import kernel
from hil.record.recording import Array

PwmFault = Literal["", "open", "short"]
_FAULTS: tuple[PwmFault, ...] = ("", "open", "short")

_PROOF = 1.33
_OPEN_AFTER = 20  # periods at full duty with hardly any current
_SHARE_OPEN = 0.1  # of the demand
_MARGIN_SHORT = 1.5  # over the rated current within one period


@dataclass(frozen=True, slots=True)
class PwmCoil:
    """A coil and its power stage.

    Attributes:
        resistance_ohm, inductance_h: of the coil, as it is now (warm copper has more).
        supply_v: of the power stage. `nominal_v`: of the coil.
        carrier_hz: of the PWM.
    """

    resistance_ohm: float
    inductance_h: float
    supply_v: float
    nominal_v: float
    carrier_hz: float

    def __post_init__(self) -> None:
        for name in ("resistance_ohm", "inductance_h", "supply_v", "nominal_v", "carrier_hz"):
            if not getattr(self, name) > 0.0:
                raise InputError(f"PWM coil: {name} = {getattr(self, name):g}; it must be above 0")

    @property
    def time_constant_s(self) -> float:
        """L/R."""
        return self.inductance_h / self.resistance_ohm

    @property
    def highest_duty(self) -> float:
        """At which the mean voltage is 133 % of the nominal one, or 1."""
        return min(1.0, _PROOF * self.nominal_v / self.supply_v)

    @property
    def highest_current_a(self) -> float:
        """Mean current at the highest duty."""
        return self.highest_duty * self.supply_v / self.resistance_ohm

    def duty(self, current_a: float) -> float:
        """Duty that makes a mean current at rest.

        Raises:
            InputError: the current is below 0, or above what the coil's proof voltage and the supply allow.
        """
        if not 0.0 <= current_a <= self.highest_current_a:
            raise InputError(
                f"{current_a:g} A through {self.resistance_ohm:g} Ω; 0 … {self.highest_current_a:.3g} A are allowed "
                f"(supply {self.supply_v:g} V, 133 % of {self.nominal_v:g} V at most)"
            )
        return current_a * self.resistance_ohm / self.supply_v

    def extremes(self, duty: float) -> tuple[float, float]:
        """Lowest and highest current of the steady ripple at a duty; its mean is duty·supply/R exactly."""
        period = 1.0 / (self.carrier_hz * self.time_constant_s)
        full = self.supply_v / self.resistance_ohm
        top = full * math.expm1(-duty * period) / math.expm1(-period)
        return top * math.exp(-(1.0 - duty) * period), top


@dataclass(frozen=True, slots=True)
class CurrentLoop:
    """A sampled PI loop about the coil, one duty per carrier period, with its faults.

    Attributes:
        bandwidth_rad_s: of the closed loop; the controller's zero cancels the nominal coil's pole.
        nominal: the coil that the controller is tuned for.
        rated_a: no demand is followed beyond it, and a current half as much again is a short.
    """

    bandwidth_rad_s: float
    nominal: PwmCoil
    rated_a: float


class PwmDrive:
    """A power stage with its loop about a coil, run tick by tick; what flows is the mean over each tick.

    A tick may be shorter than a carrier period, which then shows as ripple, or longer, which averages over it.

    Args:
        loop: the controller and the coil that it is tuned for.
        coil: the one that is there.
        rest_a: the demand under which it has come to rest.

    Attributes:
        fault: what opened the switch for good; "" while nothing has.
        fault_s: after how long, NaN without one.
    """

    def __init__(self, loop: CurrentLoop, coil: PwmCoil, rest_a: float = 0.0) -> None:
        self._loop, self._coil = loop, coil
        period_s = 1.0 / loop.nominal.carrier_hz
        rest = min(max(rest_a, 0.0), loop.rated_a, coil.highest_current_a)
        duty = rest * coil.resistance_ohm / coil.supply_v
        low, _ = coil.extremes(duty)
        # 0 time in the period, 1 current, 2 charge of the period so far, 3 duty, 4 mean current of the period before,
        # 5 volts held by the integral, 6 starved periods, 7 fault, 8 time, 9 time of the fault, 10 demand
        self._state = np.array(
            [period_s, low, rest * period_s, duty, rest, rest * coil.resistance_ohm, 0.0, 0.0, 0.0, math.nan, rest]
        )

    @property
    def fault(self) -> PwmFault:
        """See the class."""
        return _FAULTS[int(self._state[7])]

    @property
    def fault_s(self) -> float:
        """See the class."""
        return float(self._state[9])

    def checkpoint(self) -> Callable[[], None]:
        """Keep how it stands; what is returned takes it back there."""
        state = self._state.copy()

        def roll_back() -> None:
            self._state[:] = state

        return roll_back

    def drive(self, demand_a: Array, tick_s: float) -> Array:
        """Mean current over each tick for one demand per tick, shape (n,)."""
        nominal, coil = self._loop.nominal, self._coil
        period_s = 1.0 / nominal.carrier_hz
        made = np.empty(len(demand_a))
        _switched(
            np.ascontiguousarray(demand_a, dtype=np.float64), tick_s, period_s, self._state,
            self._loop.bandwidth_rad_s * nominal.inductance_h,
            self._loop.bandwidth_rad_s * nominal.resistance_ohm * period_s,
            nominal.highest_duty * nominal.supply_v, nominal.supply_v, self._loop.rated_a,
            coil.supply_v / coil.resistance_ohm, coil.time_constant_s, made,
        )  # fmt: skip
        return made


@kernel(error_model="numpy")
def _switched(
    demand: Any, tick_s: Any, period_s: Any, s: Any, proportional: Any, integral: Any, limit_v: Any, supply_v: Any,
    rated: Any, full: Any, tau: Any, out: Any,
) -> None:  # fmt: skip
    """Ticks through carrier periods; between two switchings the current is one exponential."""
    near = 1e-9 * period_s
    for k in range(len(demand)):
        left, area = tick_s, 0.0
        wanted = min(demand[k], rated)
        while left > near:
            if s[0] >= period_s - near:
                _next_period(s, wanted, period_s, proportional, integral, limit_v, supply_v)
            on = s[3] * period_s
            is_on = s[0] < on - near
            span = min((on if is_on else period_s) - s[0], left)
            towards = full if is_on else 0.0
            end = towards + (s[1] - towards) * math.exp(-span / tau)
            ceiling = _MARGIN_SHORT * rated
            if is_on and end > ceiling and s[7] == 0.0:
                span = 0.0 if s[1] >= ceiling else -tau * math.log((ceiling - full) / (s[1] - full))
                end = max(ceiling, s[1])
                s[3] = (s[0] + span) / period_s
                s[7], s[9] = 2.0, s[8] + span
            charge = towards * span + tau * (s[1] - end)
            area += charge
            s[2] += charge
            s[0] += span
            s[8] += span
            s[1] = end
            left -= span
        out[k] = area / tick_s


@kernel(error_model="numpy")
def _next_period(
    s: Any, wanted: Any, period_s: Any, proportional: Any, integral: Any, limit_v: Any, supply_v: Any
) -> None:
    """What the loop decides between two periods: the duty of the next, and whether there is a circuit at all."""
    s[4] = s[2] / period_s
    if s[8] > 0.0:
        starved = s[3] * supply_v >= limit_v - 1e-9 and s[4] < _SHARE_OPEN * s[10]
        s[6] = s[6] + 1.0 if starved else 0.0
        if s[7] == 0.0 and s[6] >= _OPEN_AFTER:
            s[7], s[9] = 1.0, s[8]
    error = wanted - s[4]
    asked = proportional * error + s[5]
    volts = min(max(asked, 0.0), limit_v)
    if (
        asked <= limit_v or error < 0.0
    ):  # at zero volts it goes on: the mean is kept when dither falls faster than the coil
        s[5] = min(max(s[5] + integral * error, 0.0), limit_v)
    s[3] = 0.0 if s[7] > 0.0 else volts / supply_v
    s[0], s[2], s[10] = 0.0, 0.0, wanted
