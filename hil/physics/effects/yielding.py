"""Hysteresis of a part that yields: it carries like a spring at first, and flows beyond its yield force."""

from __future__ import annotations

import math
from typing import Any

from hil.physics.effect import Effect, EffectParameter, compiled, grid, shares


@compiled
def transform(value: float, velocity: float, step_s: float, state: Any, strength: float, give: float) -> float:
    """Add the force of what yields; state: how much of its strength is in use, from −1 to 1.

    The step is exact for motion one way, so that it holds for samples of any distance.
    """
    travel = velocity * step_s
    if travel != 0.0 and step_s < math.inf:
        slip = 1.0 if travel > 0.0 else -1.0
        state[0] = slip + (state[0] - slip) * math.exp(-abs(travel) / give)
    return value + strength * state[0]


@compiled
def settle(value: float, velocity: float, state: Any, strength: float) -> float:
    """It flows at a steady speed, and is relaxed at rest."""
    state[0] = 0.0 if velocity == 0.0 else math.copysign(1.0, velocity)
    return value + strength * state[0]


EFFECT = Effect(
    name="yielding",
    known_as="hysteresis",
    title="hysteresis of what yields",
    hooks=("field",),
    parameters=(
        EffectParameter(
            "strength", "{value}", 0.0, 0.3, -3.0, 3.0, "force at which it flows, with the signs of the bench"
        ),
        EffectParameter("give", "{motion}", None, 0.1, 0.001, 10.0, "travel in which most of the force builds up"),
    ),
    transform=transform,
    starts=grid(strength=shares("size", 0.2, 0.7), give=(0.02, 0.1, 0.5)),
    memory=1,
    settle=settle,
    equation="F = F_y·z;  ż = (v − |v|·z)/x_0",
    signature="a loop of force over speed that closes at high speed, steep about zero speed",
    source="Wen: Method for random vibration of hysteretic systems, J. Eng. Mech. Div. 102(2), 1976",
    sentence="Part of the force of up to {strength} lags behind the motion: it builds up over {give} of travel.",
)
