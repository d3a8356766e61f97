"""Asymmetry: one direction has another gain than the other."""

from __future__ import annotations

from hil.physics.effect import Effect, EffectParameter, compiled, grid


@compiled
def transform(value: float, ratio: float, gain: float) -> float:
    """Both sides times `gain`, the negative one times `ratio` too."""
    if value < 0.0:
        return value * ratio * gain
    return value * gain


EFFECT = Effect(
    name="asymmetry",
    title="direction-dependent gain",
    hooks=("command", "opening", "flow"),
    parameters=(
        EffectParameter("ratio", "1", 1.0, 1.1, 0.3, 3.0, "gain of the negative side over the positive"),
        EffectParameter("gain", "1", None, 1.0, 0.3, 3.0, "gain of the positive side over what it should be"),
    ),
    transform=transform,
    starts=grid(ratio=(0.7, 0.9, 1.1, 1.4)),
    equation="y = g·u for u ≥ 0, g·r·u for u < 0",
    signature="even harmonics and a shift of the mean when the sign changes; another gain on either side",
    source="Merritt: Hydraulic Control Systems, 1967, ch. 6",
    sentence="One direction gives {ratio:%} of what the other does.",
)
