"""Sensor offset: the instrument reads a constant beside the truth."""

from __future__ import annotations

from hil.physics.effect import Effect, EffectParameter, compiled, grid, shares


@compiled
def transform(value: float, offset: float) -> float:
    """Add a constant."""
    return value + offset


EFFECT = Effect(
    name="sensor_offset",
    title="offset of the sensor",
    hooks=("sensor", "recorder"),
    parameters=(EffectParameter("offset", "{value}", 0.0, 0.01, -0.5, 0.5, "what it reads beside the truth"),),
    transform=transform,
    starts=grid(offset=shares("size", 0.01, -0.01)),
    equation="y = u + o",
    signature="the same shift at any command and any speed",
    source="JCGM 100:2008 (GUM)",
    sentence="The instrument reads {offset} beside the truth.",
)
