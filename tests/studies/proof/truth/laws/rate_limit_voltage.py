"""The coil's current can rise only as fast as what is left of the supply voltage allows, and falls faster."""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import EFC, Law


def equation(x: float, a: float, b: float, r: Any) -> float:
    share, full_current, fall = r.p[0], r.p[1], r.p[2]
    if share <= 0.0:
        return x
    rise = 30.0 / share * max(0.05, 1.0 - a / full_current)
    drop = 30.0 / share * (fall + a / full_current)
    limit = rise if x > 0.0 else drop
    return x / (1.0 + abs(x / limit) ** 10.0) ** 0.1


LAW = Law(
    effect="rate_limit",
    strength="reference_over_limit",
    others={"full_current_a": (5.0, 7.0), "fall": (0.35, 0.6)},
    largest={EFC: 40.0},
    equation=equation,
    at=slots.RATE,
)
