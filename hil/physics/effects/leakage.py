"""Leakage: flow past the closed edge, less of it the further the valve is open, more on the side of a worn land."""

from __future__ import annotations

from hil.physics.effect import Effect, EffectParameter, Seen, compiled


@compiled
def transform(value: float, opening: float, leak: float, fall: float, lean: float) -> float:
    """Add the leak, which falls with opening, and differs from side to side."""
    return value + leak * max(1.0 - fall * abs(opening) + lean * opening, 0.0)


def starts(seen: Seen) -> list[dict[str, float]]:
    """Small, of either sign, and with one land worn."""
    even = [{"leak": share * seen.size} for share in (0.01, 0.05, -0.01, -0.05)]
    return [*even, *({"leak": 0.03 * seen.size, "lean": lean} for lean in (-0.5, 0.5))]


EFFECT = Effect(
    name="leakage",
    title="leakage",
    hooks=("flow",),
    parameters=(
        EffectParameter("leak", "{value}", 0.0, 0.02, -0.3, 0.3, "what passes the closed edge"),
        EffectParameter("fall", "1", None, 0.3, 0.0, 1.0, "share of the leak that is gone at full opening"),
        EffectParameter("lean", "1", None, 0.0, -1.0, 1.0, "share of it by which the open side leaks more"),
    ),
    transform=transform,
    starts=starts,
    equation="q = q_v + q_L·(1 − f·|x| + a·x)",
    signature="output at zero command, most of it around centre, no dynamics",
    source="Merritt: Hydraulic Control Systems, 1967, ch. 5",
    sentence="Oil passes where the valve should be closed: {leak} at centre.",
)
