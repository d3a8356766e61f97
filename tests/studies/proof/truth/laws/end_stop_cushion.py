"""The cylinder meets a cushioned stop before the end of its stroke: oil can leave only as the cushion is pressed."""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import SP08, Law, Shared


def equation(x: float, a: float, b: float, r: Any) -> float:
    deep = a - (r.p[1] - r.p[0])
    if deep <= 0.0:
        return x
    return min(x, 0.0) if deep > r.p[2] else min(x, x * (1.0 - deep / r.p[2]))


LAW = Law(
    effect="end_stop",
    strength="moved_in_mm",
    others={"reach_mm": 188.0, "cushion_mm": (0.3, 0.8)},
    largest={SP08: 70.0},
    equation=equation,
    at=slots.TRAVEL,
    shared=(Shared("position", "mm", lambda p: p[1] - p[0]),),
)
