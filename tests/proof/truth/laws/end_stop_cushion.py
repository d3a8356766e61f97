"""The cylinder meets a cushioned stop before the end of its stroke: oil can leave only as the cushion is pressed."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import SP08, Law, Shared


def equation(x: float, a: float, b: float, r: Any) -> float:
    deep = a - (r.p[1] - r.p[0])
    if deep <= 0.0:
        return x
    return min(x, 0.0) if deep > r.p[2] else min(x, x * (1.0 - deep / r.p[2]))


def draw(rng: np.random.Generator, plant: str) -> tuple[float, ...]:
    return 188.0, rng.uniform(0.3, 0.8)


LAW = Law(
    effect="end_stop",
    meaning=("moved_in_mm", "reach_mm", "cushion_mm"),
    largest={SP08: 70.0},
    draw=draw,
    equation=equation,
    slot={SP08: slots.TRAVEL},
    shared=(Shared("position", "mm", lambda p: p[1] - p[0]),),
)
