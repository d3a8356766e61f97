"""Leakage: flow past the closed edge, less of it the further the valve is open, more on the side of a worn land."""

from __future__ import annotations

import math

from hil.physics.effect import Effect, EffectParameter, Seen, compiled


@compiled
def transform(value: float, opening: float, leak: float, fall: float, lean: float) -> float:
    """Add the leak, which fades with opening, on the side of a worn land less so."""
    side = lean if opening > 0.0 else -lean
    return value + leak * math.exp(-fall * (1.0 - side) * abs(opening))


def starts(seen: Seen) -> list[dict[str, float]]:
    """Small, of either sign, and with one land worn."""
    even = [{"leak": share * seen.size} for share in (0.01, 0.05, -0.01, -0.05)]
    return [*even, *({"leak": 0.03 * seen.size, "lean": lean} for lean in (-0.7, 0.7))]


EFFECT = Effect(
    name="leakage",
    title="leakage",
    hooks=("flow",),
    parameters=(
        EffectParameter("leak", "{value}", 0.0, 0.02, -0.3, 0.3, "what passes the closed edge"),
        EffectParameter("fall", "1", None, 0.5, 0.0, 20.0, "full opening over that at which a third is left"),
        EffectParameter(
            "lean", "1", None, 0.0, -1.0, 1.0, "by how much less so on the positive side, more on the other"
        ),
    ),
    transform=transform,
    starts=starts,
    equation="q = q_v + q_L·exp(−f·(|x| − a·x))",
    signature="output at zero command, most of it around centre, no dynamics",
    source="Merritt: Hydraulic Control Systems, 1967, ch. 5",
    sentence="Oil passes where the valve should be closed: {leak} at centre.",
)
