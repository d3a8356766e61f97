"""Resistance and inductance of a coil from its voltage and current while the current goes up and down.

V = R·i + L·di/dt holds whatever drives the coil, and for means over a PWM period as well. Resistance is the change
of voltage over that of current between two rests, which removes the offsets of both instruments; inductance is
what the area under the voltage has beyond the resistance's share.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hil.errors import InputError
from hil.identification.steady.criteria import CRITERIA
from hil.record.recording import Array
from hil.signals.interval import UNIFORM
from hil.signals.runs import runs

COPPER_PER_K = 0.00393  # at 20 °C
_COPPER_AT_C = 20.0


@dataclass(frozen=True, slots=True)
class Coil:
    """What a coil was found to be.

    Attributes:
        resistance_ohm, resistance_std_ohm: at the temperature of the test; infinite without a current.
        inductance_h, inductance_std_h: NaN without a current.
        voltage_v, current_a: means while the current stood. `voltage_std_v`: how the voltage's mean scatters.
        asked_a: the current that was asked for.
    """

    resistance_ohm: float
    resistance_std_ohm: float
    inductance_h: float
    inductance_std_h: float
    voltage_v: float
    current_a: float
    asked_a: float
    voltage_std_v: float = 0.0

    @property
    def is_open(self) -> bool:
        """No current flows although it is asked for."""
        return abs(self.current_a) < 0.2 * abs(self.asked_a)


@dataclass(frozen=True, slots=True)
class CoilReadings:
    """Samples of one test, each of shape (n,): what was asked for, and what the instruments read.

    Stamps need not be even: a link that is polled answers a little early or late.
    """

    time_s: Array
    demand_a: Array
    current_a: Array
    voltage_v: Array


def copper_factor(temperature_c: float, reference_c: float) -> float:
    """Resistance of copper at a temperature over that at another."""

    def over_20(at_c: float) -> float:
        return 1.0 + COPPER_PER_K * (at_c - _COPPER_AT_C)

    return over_20(temperature_c) / over_20(reference_c)


def fit_coil(readings: CoilReadings) -> Coil:
    """Resistance and inductance from every rise and fall of the demand between two rests.

    Raises:
        InputError: the demand does not rise and fall between rests of at least 0.2 s.
    """
    # first and end sample of every stretch of at least 0.2 s in which the demand stands
    still, time_s = np.diff(readings.demand_a) == 0.0, readings.time_s
    rests = [(a, b + 1) for a, b in runs(still) if time_s[b] - time_s[a] >= CRITERIA.rest_s - 1e-9]
    if len(rests) < 3:
        raise InputError("coil: the current must rise and fall between rests of at least 0.2 s")
    levels = [_level(readings, rest) for rest in rests]
    found = np.array([
        _between(readings, before, after, low, high)
        for (before, after), (low, high) in zip(pairwise(rests), pairwise(levels), strict=True)
    ])  # fmt: skip
    top = max(levels, key=lambda level: abs(level[0]))
    asked, voltage, current = top
    without_current = Coil(math.inf, 0.0, math.nan, math.inf, voltage, current, asked)
    if without_current.is_open:
        return without_current
    tops = [level[1] for level in levels if abs(level[0]) > 0.5 * abs(asked)]
    (ohm, henry), spread = found[:, :2].mean(axis=0), found[:, :2].std(axis=0, ddof=1) / math.sqrt(len(found))
    spread[0] *= math.sqrt(2.0)  # neighbouring changes share a rest
    grain = float(found[:, 2].mean()) / math.sqrt(2.0)  # alike in every rise, and in every fall
    return Coil(
        float(ohm), float(spread[0]), float(henry), math.hypot(float(spread[1]), grain), voltage, current, asked,
        float(np.std(tops, ddof=1)) if len(tops) > 1 else 0.0,
    )  # fmt: skip


def _settled(rest: tuple[int, int]) -> slice:
    """The second half of a rest."""
    return slice((rest[0] + rest[1]) // 2, rest[1])


def _level(readings: CoilReadings, rest: tuple[int, int]) -> tuple[float, float, float]:
    part = _settled(rest)
    return (
        float(readings.demand_a[part].mean()), float(readings.voltage_v[part].mean()),
        float(readings.current_a[part].mean()),
    )  # fmt: skip


def _between(
    readings: CoilReadings, before: tuple[int, int], after: tuple[int, int],
    low: Sequence[float], high: Sequence[float],
) -> tuple[float, float, float]:  # fmt: skip
    """Resistance, inductance, and what sampling may hide of the inductance, from one change of the current."""
    step_v, step_a = high[1] - low[1], high[2] - low[2]
    if step_a == 0.0:
        return math.inf, math.nan, math.inf
    ohm = step_v / step_a
    part = slice(_settled(before).start, _settled(after).start)
    rest_v = readings.voltage_v[part] - low[1] - ohm * (readings.current_a[part] - low[2])
    area = float(np.trapezoid(rest_v, readings.time_s[part]))
    hidden = float(np.max(np.abs(np.diff(readings.voltage_v[part])) * np.diff(readings.time_s[part])))
    return ohm, area / step_a, UNIFORM * hidden / abs(step_a)
