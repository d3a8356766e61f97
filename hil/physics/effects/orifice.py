"""Orifice law: the load pressure takes its share of the pressure that drives oil through the metering edge."""

from __future__ import annotations

import math

from hil.physics.effect import Effect, EffectParameter, compiled, grid


@compiled
def transform(value: float, load_pressure: float, share: float) -> float:
    """Flow with the root of what is left over the edge; a load that pulls increases it."""
    against = share * load_pressure if value > 0.0 else -share * load_pressure
    return value * math.sqrt(max(1.0 - against, 0.0))


EFFECT = Effect(
    name="orifice",
    title="orifice law of the metering edge",
    hooks=("edge",),
    parameters=(
        EffectParameter("share", "1", 0.0, 0.2, 0.0, 2.0, "load pressure at a load of 1, over the supply pressure"),
    ),
    transform=transform,
    starts=grid(share=(0.05, 0.15, 0.3, 0.6)),
    equation="q = q_0·√(1 − sgn(q_0)·p_L/p_S)",
    signature="gain falls where the load holds against the motion and rises where it helps; open valves damp",
    source="Merritt: Hydraulic Control Systems, 1967, ch. 5",
    sentence="The load takes pressure from the valve: each unit of it costs {share:%} of the supply.",
)
