"""Turbulent loss: lines and fittings take pressure with the square of the speed."""

from __future__ import annotations

import math

from hil.physics.effect import Effect, EffectParameter, Seen, compiled


@compiled
def transform(value: float, mobility: float, loss: float) -> float:
    """The force of one sub-step; implicit, so that it can stop the part but never turn it round."""
    gain = mobility * loss
    if gain <= 1e-12:
        return loss * value * abs(value)
    speed = 2.0 * abs(value) / (1.0 + math.sqrt(1.0 + 4.0 * gain * abs(value)))
    return math.copysign(loss * speed * speed, value)


def starts(_seen: Seen) -> list[dict[str, float]]:
    """Small to large against the pressure at full speed."""
    return [{"loss": loss} for loss in (0.1, 0.5, 2.0, 10.0)]


EFFECT = Effect(
    name="turbulent_loss",
    title="turbulent loss in the lines",
    hooks=("line",),
    parameters=(EffectParameter("loss", "1", 0.0, 0.5, 0.0, 200.0, "pressure lost at full speed"),),
    transform=transform,
    starts=starts,
    equation="Δp = R·v·|v|",
    signature="much damping in fast motion, hardly any in slow motion: ringing goes on at standstill",
    source="Merritt: Hydraulic Control Systems, 1967, ch. 3",
    sentence="Lines and fittings brake fast motion: at full speed they take {loss} of pressure.",
)
