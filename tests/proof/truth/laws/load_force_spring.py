"""A load that grows along the stroke takes pressure from extending and gives it to retracting.

speed·√(1 − sgn(opening)·p), p = s·(½ + ½·(y − y0)/reach)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import SP08, Law


def equation(x: float, a: float, b: float, r: Any) -> float:
    load = r.p[0] * (0.5 + 0.5 * (b - r.p[1]) / r.p[2])
    return x * np.sqrt(max(0.05, 1.0 - load if a > 0.0 else 1.0 + load))


def draw(rng: np.random.Generator, plant: str) -> tuple[float, ...]:
    return rng.uniform(110.0, 140.0), rng.uniform(60.0, 80.0)


LAW = Law(
    effect="load_force",
    meaning=("share_of_supply", "middle_mm", "reach_mm"),
    largest={SP08: 0.8},
    draw=draw,
    equation=equation,
    slot={SP08: slots.FLOW},
)
