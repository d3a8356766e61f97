"""Quantisation: readings come in steps coarser than the converter's."""

from __future__ import annotations

import math

from hil.physics.effect import Effect, EffectParameter, Seen, compiled


@compiled
def transform(value: float, step: float) -> float:
    """Round to whole steps."""
    if step <= 0.0:
        return value
    return math.floor(value / step + 0.5) * step


def starts(seen: Seen) -> list[dict[str, float]]:
    """From fine to coarse; the error has no slope, so the grid is close."""
    return [{"step": seen.size / count} for count in (400, 300, 220, 160, 120, 90, 64, 48, 32, 24, 16)]


EFFECT = Effect(
    name="quantisation",
    title="coarse quantisation",
    hooks=("sensor", "recorder", "command"),
    parameters=(EffectParameter("step", "{value}", 0.0, 0.01, 0.0, 0.3, "size of a step"),),
    transform=transform,
    starts=starts,
    equation="y = round(u/q)·q",
    signature="readings only at whole steps; a saw-tooth error on slow ramps",
    source="Widrow, Kollár: Quantization Noise, 2008",
    sentence="The signal comes in steps of {step}.",
)
