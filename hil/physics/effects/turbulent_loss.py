"""Turbulent loss: lines and fittings take pressure with the square of the speed."""

from __future__ import annotations

import math
from typing import Any

from hil.physics.effect import Effect, EffectParameter, compiled, grid


@compiled
def transform(value: float, mobility: float, state: Any, loss: float) -> float:
    """The force of one sub-step at the mean of the speeds before and after it, found implicitly. State: last speed."""
    mean = 0.5 * (state[0] + value)
    gain = 0.5 * mobility * loss
    speed = 2.0 * abs(mean) / (1.0 + math.sqrt(1.0 + 4.0 * gain * abs(mean)))
    force = math.copysign(loss * speed * speed, mean)
    state[0] = value - mobility * force
    return force


@compiled
def settle(value: float, mobility: float, state: Any, loss: float) -> float:
    """As fast before as after."""
    state[0] = value
    return transform(value, mobility, state, loss)


EFFECT = Effect(
    name="turbulent_loss",
    title="turbulent loss in the lines",
    hooks=("line",),
    parameters=(EffectParameter("loss", "1", 0.0, 0.5, 0.0, 200.0, "pressure lost at full speed"),),
    transform=transform,
    settle=settle,
    memory=1,
    starts=grid(loss=(0.1, 0.5, 2.0, 10.0)),
    equation="Δp = R·v·|v|",
    signature="much damping in fast motion, hardly any in slow motion: ringing goes on at standstill",
    source="Merritt: Hydraulic Control Systems, 1967, ch. 3",
    sentence="Lines and fittings brake fast motion: at full speed they take {loss} of pressure.",
)
