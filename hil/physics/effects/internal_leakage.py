"""Internal leakage: oil passes from the chamber of higher pressure to the other, past piston and pump."""

from __future__ import annotations

import math

from hil.physics.effect import Effect, EffectParameter, compiled, grid, shares


@compiled
def transform(value: float, pressure: float, leak: float, power: float) -> float:
    """Take away what leaks; `leak` is at 10 bar, so that it means the same for every exponent."""
    return value - math.copysign(leak * (0.1 * abs(pressure)) ** power, pressure)


EFFECT = Effect(
    name="internal_leakage",
    title="leakage that grows with pressure",
    hooks=("chamber",),
    parameters=(
        EffectParameter("leak", "{value}", 0.0, 0.01, 0.0, 1.0, "what leaks at 10 bar"),
        EffectParameter(
            "power", "1", None, 1.0, 0.5, 3.0, "0.5: an orifice, 1: a gap, more: gaps that widen with pressure"
        ),
    ),
    transform=transform,
    starts=grid(leak=shares("size", 0.002, 0.01, 0.04), power=(1.0, 2.0)),
    equation="q_L = k·sgn(Δp)·|Δp/10 bar|^m",
    signature="the part creeps under load with the drive at rest; slower against a load, faster with it",
    source="Merritt: Hydraulic Control Systems, 1967, ch. 4",
    sentence="Oil leaks from one chamber to the other: {leak} at 10 bar, growing with pressure to the power {power}.",
)
