"""Asymmetry: one direction has another gain than the other."""

from __future__ import annotations

import math

from hil.physics.effect import Effect, EffectParameter, Seen, compiled


@compiled
def transform(value: float, ratio: float, gain: float, blend: float) -> float:
    """Both sides times `gain`, the negative one times `ratio` too; about zero one passes into the other."""
    if blend > 0.0:
        negative = 0.5 - 0.5 * value / math.sqrt(value * value + blend * blend)
        return value * gain * (1.0 + (ratio - 1.0) * negative)
    if value < 0.0:
        return value * ratio * gain
    return value * gain


def starts(seen: Seen) -> list[dict[str, float]]:
    """Either side weaker, with hardly a passage between them."""
    return [{"ratio": ratio, "blend": 0.005 * seen.size} for ratio in (0.7, 0.9, 1.1, 1.4)]


EFFECT = Effect(
    name="asymmetry",
    title="direction-dependent gain",
    hooks=("command", "opening", "flow"),
    parameters=(
        EffectParameter("ratio", "1", 1.0, 1.1, 0.3, 3.0, "gain of the negative side over the positive"),
        EffectParameter("gain", "1", 1.0, 1.0, 0.3, 3.0, "gain of the positive side over what it should be"),
        EffectParameter("blend", "{value}", None, 0.0, 0.0, 0.2, "about zero, where one side passes into the other"),
    ),
    transform=transform,
    starts=starts,
    equation="y = g·u·(1 + (r − 1)·(1 − u/√(u² + b²))/2)",
    signature="even harmonics and a shift of the mean when the sign changes; another gain on either side",
    source="Merritt: Hydraulic Control Systems, 1967, ch. 6",
    sentence="One direction gives {ratio:%} of what the other does.",
)
