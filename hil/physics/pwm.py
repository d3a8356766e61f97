"""A coil behind a PWM power stage: ripple, duty, dither, and the current loop that drives it, switch by switch.

While the switch is on, the supply drives the coil; while it is off, the current flows on through a diode. Both stages
are solved exactly, so nothing depends on a step size. The mean voltage never exceeds 133 % of the coil's nominal one,
the proof voltage of the EFC thesis, whatever the supply is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hil.errors import InputError
from hil.record.recording import Array

PwmFault = Literal["", "open", "short"]

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
    def corner_hz(self) -> float:
        """Corner frequency from voltage to current."""
        return 1.0 / (2.0 * math.pi * self.time_constant_s)

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

    def ripple(self, duty: float) -> float:
        """Peak to peak current of the steady ripple: the dither that a slow carrier makes by itself."""
        low, high = self.extremes(duty)
        return high - low


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


@dataclass(frozen=True, slots=True)
class PwmRun:
    """What a loop did, period by period; arrays of shape (n,).

    Attributes:
        time_s: beginnings of the periods. `duty`: in each.
        mean_a: mean current of each. `low_a`, `high_a`: its extremes.
        fault: what ended it. After it the switch stays off. `fault_s`: when, NaN without one.
    """

    time_s: Array
    duty: Array
    mean_a: Array
    low_a: Array
    high_a: Array
    fault: PwmFault
    fault_s: float


def run_loop(loop: CurrentLoop, coil: PwmCoil, demand_a: Array) -> PwmRun:
    """Drive a coil, which may differ from the nominal one, with one demand per carrier period, from no current.

    The loop reads the mean current of the period before. A current above half as much again as rated opens the
    switch within the period (short); full duty for 20 periods with less than a tenth of the demand is an open circuit.
    """
    period_s = 1.0 / coil.carrier_hz
    nominal = loop.nominal
    proportional = loop.bandwidth_rad_s * nominal.inductance_h
    integral = loop.bandwidth_rad_s * nominal.resistance_ohm * period_s
    limit_v = nominal.highest_duty * nominal.supply_v
    rows = np.zeros((4, len(demand_a)))
    current, mean, held_v, starved = 0.0, 0.0, 0.0, 0
    fault: PwmFault = ""
    fault_s = math.nan
    for k, demand in enumerate(demand_a):
        error = min(float(demand), loop.rated_a) - mean
        wanted = proportional * error + held_v
        volts = min(max(wanted, 0.0), limit_v)
        if wanted == volts:
            held_v += integral * error
        duty = 0.0 if fault else volts / nominal.supply_v
        start, (current, mean, low, high) = current, _period(coil, current, duty, period_s)
        if not fault and high > _MARGIN_SHORT * loop.rated_a:
            duty = _until(coil, start, _MARGIN_SHORT * loop.rated_a, duty, period_s)
            current, mean, low, high = _period(coil, start, duty, period_s)
            fault, fault_s = "short", (k + duty) * period_s
        starved = starved + 1 if volts == limit_v and mean < _SHARE_OPEN * min(float(demand), loop.rated_a) else 0
        if not fault and starved >= _OPEN_AFTER:
            fault, fault_s = "open", (k + 1) * period_s
        rows[:, k] = duty, mean, low, high
    time_s = np.arange(len(demand_a), dtype=np.float64) * period_s
    return PwmRun(time_s, rows[0], rows[1], rows[2], rows[3], fault, fault_s)


def dithered(demand_a: Array, carrier_hz: float, dither_hz: float, amplitude_a: float) -> Array:
    """A demand with a sine about it, one value per carrier period.

    Raises:
        InputError: the carrier has fewer than four periods per dither period, or not a whole number of them, so that
            the dither would change the mean.
    """
    ratio = carrier_hz / dither_hz
    if ratio < 4.0 or abs(ratio - round(ratio)) > 1e-9:
        raise InputError(
            f"dither of {dither_hz:g} Hz on a carrier of {carrier_hz:g} Hz: the carrier must be a whole multiple, four "
            "or more, or the dither changes the mean current"
        )
    made: Array = demand_a + amplitude_a * np.sin(2.0 * math.pi * np.arange(len(demand_a)) / ratio)
    return made


def _period(coil: PwmCoil, start: float, duty: float, period_s: float) -> tuple[float, float, float, float]:
    """(end, mean, lowest, highest) of the current over a period that begins with the switch on."""
    tau, full = coil.time_constant_s, coil.supply_v / coil.resistance_ohm
    on, off = duty * period_s, (1.0 - duty) * period_s
    top = full + (start - full) * math.exp(-on / tau)
    end = top * math.exp(-off / tau)
    area = full * on - tau * (top - start) + tau * (top - end)
    return end, area / period_s, min(start, end), max(start, top)


def _until(coil: PwmCoil, start: float, level: float, duty: float, period_s: float) -> float:
    """Share of the period after which the current reaches a level."""
    full = coil.supply_v / coil.resistance_ohm
    if start >= level or full <= level:
        return 0.0
    reached_s = -coil.time_constant_s * math.log((level - full) / (start - full))
    return min(duty, reached_s / period_s)
