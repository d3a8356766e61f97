"""Sensor lag: the instrument follows late, as a system of first or second order."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.effect import Effect, EffectParameter, at_rest, compiled, grid
from hil.physics.linear import first_order
from hil.physics.steps import spring_step

# Below this the second order is over within far less than a sub-step.
_FIRST_ORDER = 1e-4


@compiled
def transform(
    value: float, state: Any,
    xx: float, xv: float, x0: float, x1: float, vx: float, vv: float, v0: float, v1: float,
) -> float:  # fmt: skip
    """A step of reading and speed, exact for a value that runs straight since the last one."""
    reading, speed, before = state[0], state[1], state[2]
    state[0] = xx * reading + xv * speed + x0 * before + x1 * value
    state[1] = vx * reading + vv * speed + v0 * before + v1 * value
    state[2] = value
    return state[0]


def second_order_shape(parameters: Mapping[str, float]) -> tuple[float, float] | None:
    """Natural frequency in rad/s and damping ratio; None for a lag of first order, and for none at all."""
    lag_s, second = parameters["lag"], parameters["second"]
    if second < _FIRST_ORDER or lag_s <= 1e-9:
        return None
    damping = 1.0 / math.sqrt(second)
    return 2.0 * damping / lag_s, damping


def coefficients(parameters: Mapping[str, float], step_s: float) -> dict[str, float]:
    """The step of reading and speed."""
    shape = second_order_shape(parameters)
    if shape is None:
        keep, old, new = first_order(parameters["lag"], step_s)
        return dict.fromkeys(("xv", "vx", "vv", "v0", "v1"), 0.0) | {"xx": keep, "x0": old, "x1": new}
    return spring_step(*shape, step_s)


EFFECT = Effect(
    name="sensor_lag",
    title="lag of the sensor",
    hooks=("sensor", "recorder"),
    parameters=(
        EffectParameter("lag", "s", 0.0, 0.01, 0.0, 0.5, "time constant, of two that follow each other their sum"),
        EffectParameter("second", "1", None, 0.0, 0.0, 2.0, "0: one time constant, 1: two equal ones, above: inertia"),
    ),
    transform=transform,
    starts=grid(lag=(0.004, 0.012, 0.035, 0.1), second=(0.0, 0.9)),
    memory=3,
    settle=at_rest,
    coefficients=coefficients,
    equation="(r·T²/4·s² + T·s + 1)·y = u",
    signature="phase and gain fall with frequency, no distortion; an inner signal such as spool position is on time",
    source="Doebelin: Measurement Systems, ch. 3",
    sentence="The instrument, not the valve, is slow: it follows with a time constant of {lag}.",
)
