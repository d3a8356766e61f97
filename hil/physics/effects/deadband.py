"""Dead band: lands wider than the ports, no answer until the overlap is crossed."""

from __future__ import annotations

from hil.physics.effect import Effect, EffectParameter, compiled, grid, shares


@compiled
def transform(value: float, width: float, ratio: float) -> float:
    """Shift towards zero, zero inside; the negative side has `ratio` of the positive side's width."""
    if value > width:
        return value - width
    if value < -width * ratio:
        return value + width * ratio
    return 0.0


EFFECT = Effect(
    name="deadband",
    title="dead band",
    hooks=("command", "opening"),
    parameters=(
        EffectParameter(
            "width", "{value}", 0.0, 0.03, 0.0, 0.4, "band without answer on the positive side", by_law=0.05
        ),
        EffectParameter("ratio", "1", None, 1.0, 0.2, 5.0, "band on the negative side over that on the positive"),
    ),
    transform=transform,
    starts=grid(width=shares("size", 0.01, 0.04, 0.12, 0.3)),
    equation="y = max(u − d, 0) for u > 0, min(u + r·d, 0) for u < 0",
    signature="gain and odd harmonics without phase, residual around zero opening",
    source="Merritt: Hydraulic Control Systems, 1967, ch. 5",
    sentence="Around centre the valve gives no answer until the command has gone {width} further than it should.",
)
