"""Sensor drift: the reading creeps away with time."""

from __future__ import annotations

from hil.physics.effect import Effect, EffectParameter, Seen, compiled


@compiled
def transform(value: float, time_s: float, rate: float) -> float:
    """Add what has crept in since the start."""
    return value + rate * time_s


def starts(seen: Seen) -> list[dict[str, float]]:
    """Small, either way."""
    return [{"rate": share * seen.size / seen.duration_s} for share in (0.02, -0.02)]


EFFECT = Effect(
    name="sensor_drift",
    title="drift of the sensor",
    hooks=("sensor", "recorder"),
    parameters=(EffectParameter("rate", "{value}/s", 0.0, 0.0003, -0.1, 0.1, "creep per second"),),
    transform=transform,
    starts=starts,
    equation="y = u + r·t",
    signature="an error that grows with time, whatever the command does",
    source="JCGM 100:2008 (GUM)",
    sentence="The instrument creeps by {rate}.",
)
