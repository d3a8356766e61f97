"""Leakage across the lands: with blocked ports the load pressure comes near the supply's only gradually."""

from __future__ import annotations

from hil.physics.effect import Effect, EffectParameter, compiled, grid


@compiled
def transform(value: float, supply: float, softness: float) -> float:
    """From the pressure of a spool with sharp, tight edges to that of one whose closed edges leak."""
    if softness <= 0.02:
        return value
    return value / (1.0 + abs(value / supply) ** (1.0 / softness)) ** softness


EFFECT = Effect(
    name="land_leakage",
    title="leakage across the closed lands",
    hooks=("blocked",),
    parameters=(
        EffectParameter(
            "softness", "1", 0.0, 0.4, 0.0, 2.0, "0: sharp and tight edges; 1: as much leaks as is metered"
        ),
    ),
    transform=transform,
    starts=grid(softness=(0.1, 0.3, 0.6, 1.0)),
    equation="p_L = p_v/(1 + |p_v/p_S|^(1/s))^s,  p_v = K_p·x",
    signature="the pressure curve bends before it reaches the supply, the same way on both sides",
    source="Merritt: Hydraulic Control Systems, 1967, ch. 5",
    sentence="The edges leak where they should close: pressure comes near the supply only gradually ({softness}).",
)
