"""Backlash: play in a linkage; the driven side moves only when a flank touches."""

from __future__ import annotations

from typing import Any

from hil.physics.effect import Effect, EffectParameter, compiled, grid, shares


@compiled
def transform(value: float, state: Any, half_width: float) -> float:
    """The play operator."""
    if value - state[0] > half_width:
        state[0] = value - half_width
    elif state[0] - value > half_width:
        state[0] = value + half_width
    return state[0]


EFFECT = Effect(
    name="backlash",
    title="backlash",
    hooks=("opening", "position"),
    parameters=(EffectParameter("half_width", "{value}", 0.0, 0.01, 0.0, 0.2, "half of the play"),),
    transform=transform,
    starts=grid(half_width=shares("amplitude", 0.02, 0.07, 0.2, 0.5)),
    memory=1,
    equation="y stays until |u − y| > b, then follows at distance b",
    signature="a loop of constant width at any speed, flat tops after each reversal, odd harmonics",
    source="Tao, Kokotović: Adaptive Control of Systems with Actuator and Sensor Nonlinearities, 1996",
    sentence="There is play between the moving part and what it drives: ±{half_width} before it follows.",
)
