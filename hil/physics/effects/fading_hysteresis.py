"""Hysteresis whose memory fades with travel, however small the motions: domain walls creep along when shaken."""

from __future__ import annotations

import math
from typing import Any

from hil.physics.effect import Effect, EffectParameter, at_rest, compiled, grid, shares
from hil.physics.effects.hysteresis import narrowing


@compiled
def transform(value: float, state: Any, full_scale: float, width: float, reach: float, closing: float) -> float:
    """Duhem: the lag follows the direction of travel over `reach`, and narrows near saturation."""
    travel = value - state[0]
    state[0] = value
    if travel != 0.0:
        to = 1.0 if travel > 0.0 else -1.0
        state[1] = to + (state[1] - to) * math.exp(-abs(travel) / reach)
    return value - width * state[1] / narrowing(value, full_scale, closing)


EFFECT = Effect(
    name="fading_hysteresis",
    known_as="hysteresis",
    title="magnetic hysteresis",
    hooks=("command", "coil", "pilot"),
    parameters=(
        EffectParameter("width", "{value}", 0.0, 0.015, 0.0, 0.2, "half width of the major loop"),
        EffectParameter("reach", "{value}", None, 0.06, 0.001, 1.0, "travel after which memory has faded to a third"),
        EffectParameter(
            "closing", "1", None, 1.0, 0.0, 5.0, "full scale over the drive at which the loop is half as wide"
        ),
    ),
    transform=transform,
    settle=at_rest,
    starts=grid(width=shares("amplitude", 0.03, 0.15), reach=shares("amplitude", 0.05, 0.2, 0.8)),
    memory=2,
    equation="y = u − w·z/(1 + (c·u/U)²),  dz = (du − |du|·z)/r",
    signature="a loop that does not depend on speed, rounded after reversals; small motions wear the memory off",
    source="Visintin: Differential Models of Hysteresis, 1994, ch. V; Jiles, Atherton, J. Magn. Magn. Mater. 61, 1986",
    sentence="The magnet remembers: going up and coming down differ by ±{width}.",
)
