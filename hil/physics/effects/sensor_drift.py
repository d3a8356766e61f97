"""Sensor drift: the reading creeps away with time, for ever or until it has warmed up."""

from __future__ import annotations

import math

from hil.physics.effect import Effect, EffectParameter, Seen, compiled

# Below this share of a time constant the creep is as good as straight.
_STRAIGHT = 1e-6


@compiled
def transform(value: float, time_s: float, rate: float, settling: float) -> float:
    """Add what has crept in since the start."""
    if settling * time_s < _STRAIGHT:
        return value + rate * time_s
    return value - rate * math.expm1(-settling * time_s) / settling


def starts(seen: Seen) -> list[dict[str, float]]:
    """Small, either way, steady and settling."""
    rate, quick = 0.02 * seen.size / seen.duration_s, 6.0 / seen.duration_s
    return [{"rate": sign * r, "settling": s} for sign in (1.0, -1.0) for r, s in ((rate, 0.0), (6.0 * rate, quick))]


EFFECT = Effect(
    name="sensor_drift",
    title="drift of the sensor",
    hooks=("sensor", "recorder"),
    parameters=(
        EffectParameter("rate", "{value}/s", 0.0, 0.0003, -0.005, 0.005, "creep per second, at the start"),
        EffectParameter("settling", "1/s", None, 0.0, 0.0, 1.0, "one over the time constant of warming up; 0: steady"),
    ),
    transform=transform,
    starts=starts,
    equation="y = u + r·(1 − exp(−s·t))/s",
    signature="an error that grows with time, whatever the command does",
    source="JCGM 100:2008 (GUM)",
    sentence="The instrument creeps by {rate}.",
)
