"""Sensor lag: the instrument follows late, as a system of first or second order."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.effect import Effect, EffectParameter, Seen, compiled
from hil.physics.linear import free_motion

# Below this the second order is over within far less than a sub-step.
_FIRST_ORDER = 1e-4


@compiled
def transform(value: float, state: Any, xx: float, xv: float, vx: float, vv: float) -> float:
    """The free motion from where reading and speed are towards the value, held over the sub-step."""
    away, speed = state[0] - value, state[1]
    state[0] = value + xx * away + xv * speed
    state[1] = vx * away + vv * speed
    return state[0]


def coefficients(parameters: Mapping[str, float], step_s: float) -> dict[str, float]:
    """The free motion over one sub-step."""
    lag_s, second = parameters["lag"], parameters["second"]
    names = ("xx", "xv", "vx", "vv")
    if lag_s <= 1e-9:
        return dict.fromkeys(names, 0.0)
    if second < _FIRST_ORDER:
        return dict.fromkeys(names, 0.0) | {"xx": math.exp(-step_s / lag_s)}
    damping = 1.0 / math.sqrt(second)
    frequency = 2.0 * damping / lag_s
    return dict(zip(names, free_motion(frequency, damping * frequency, step_s), strict=True))


def starts(_seen: Seen) -> list[dict[str, float]]:
    """From milliseconds to a tenth of a second, of first and of second order."""
    return [{"lag": lag, "second": second} for lag in (0.004, 0.012, 0.035, 0.1) for second in (0.0, 0.9)]


EFFECT = Effect(
    name="sensor_lag",
    title="lag of the sensor",
    hooks=("sensor", "recorder"),
    parameters=(
        EffectParameter("lag", "s", 0.0, 0.01, 0.0, 0.5, "time constant, of two that follow each other their sum"),
        EffectParameter("second", "1", None, 0.0, 0.0, 2.0, "0: one time constant, 1: two equal ones, above: inertia"),
    ),
    transform=transform,
    starts=starts,
    memory=lambda _parameters, _step_s: 2,
    coefficients=coefficients,
    equation="(r·T²/4·s² + T·s + 1)·y = u",
    signature="phase and gain fall with frequency, no distortion; an inner signal such as spool position is on time",
    source="Doebelin: Measurement Systems, ch. 3",
    sentence="The instrument, not the valve, is slow: it follows with a time constant of {lag}.",
)
