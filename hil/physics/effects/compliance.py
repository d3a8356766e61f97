"""Compliance: oil is compressed and hoses swell, so that part of the flow raises pressure instead of moving."""

from __future__ import annotations

from typing import Any

from hil.physics.effect import Effect, EffectParameter, compiled, grid, shares


@compiled
def transform(value: float, pressure: float, step_s: float, state: Any, swell: float) -> float:
    """Take away what fills the swelling volume; state: the pressure before."""
    rise = pressure - state[0]
    state[0] = pressure
    return value - swell * rise / step_s


@compiled
def settle(value: float, pressure: float, state: Any) -> float:
    """Filled at the first pressure."""
    state[0] = pressure
    return value


EFFECT = Effect(
    name="compliance",
    title="compliance of oil and hoses",
    hooks=("chamber",),
    parameters=(EffectParameter("swell", "{motion}/bar", 0.0, 0.002, 0.0, 0.2, "volume taken up per bar, as travel"),),
    transform=transform,
    starts=grid(swell=shares("size", 0.0005, 0.003, 0.015)),
    memory=1,
    settle=settle,
    equation="q_C = C·dp/dt",
    signature="lags when pressure builds up and gives it back when pressure falls; nothing at steady pressure",
    source="Merritt: Hydraulic Control Systems, 1967, ch. 3",
    sentence="Oil and hoses give: each bar takes up {swell} before anything moves.",
)
