"""Overflow: a tank is full; what comes in spills over the brim, part of it into the next tank."""

from __future__ import annotations

import math
from typing import Any

from hil.physics.effect import Effect, EffectParameter, Seen, compiled


@compiled
def transform(value: float, spill: Any, brim: float, caught: float) -> float:
    """Keep the level at the brim; `spill` takes the share of the rest that the next tank catches."""
    if value <= brim:
        return value
    spill[0] = caught * (value - brim)
    return brim


def starts(seen: Seen) -> list[dict[str, float]]:
    """From just below the highest level down, lost and caught."""
    return [
        {"brim": seen.low + share * (seen.high - seen.low), "caught": caught}
        for share in (0.97, 0.85, 0.7, 0.5)
        for caught in (0.0, 0.5, 1.0)
    ]


EFFECT = Effect(
    name="overflow",
    title="overflow of a tank",
    hooks=("upper", "lower"),
    parameters=(
        EffectParameter("brim", "{value}", math.inf, 0.8, 0.05, 2.0, "level at which the tank spills"),
        EffectParameter("caught", "1", None, 0.5, 0.0, 1.0, "share of the spill that the next tank catches"),
    ),
    transform=transform,
    starts=starts,
    equation="h ≤ h_b;  the surplus q_s = max(dV/dt, 0) at h_b leaves, c·q_s of it into the next tank",
    signature="a level that stays flat for a while, and the next level rises at once instead of after the tank",
    source="Schoukens, Mattsson, Wigren, Noël: Cascaded tanks benchmark, nonlinearbenchmark.org 2016",
    sentence="A tank runs over when its level reaches {brim}; of the spill, {caught:%} lands in the next tank.",
)
