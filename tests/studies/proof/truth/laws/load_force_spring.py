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


LAW = Law(
    effect="load_force",
    strength="share_of_supply",
    others={"middle_mm": (110.0, 140.0), "reach_mm": (60.0, 80.0)},
    largest={SP08: 0.8},
    equation=equation,
    at=slots.FLOW,
)
