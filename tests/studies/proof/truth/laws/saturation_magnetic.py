"""Magnetic saturation: linear up to the knee of the B–H curve, then exponentially towards the limit L.

The strength is the drive's span over the limit.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import AXIS, EFC, HPV41, SP08, Law

_SPAN = {HPV41: 100.0, EFC: 2.1, SP08: 100.0, AXIS: 200.0}


def equation(x: float, a: float, b: float, r: Any) -> float:
    share, knee, span = r.p[0], r.p[1], r.p[2]
    if share <= 0.0:
        return x
    limit = span / share
    beyond = abs(x) - knee * limit
    if beyond <= 0.0:
        return x
    rest = (1.0 - knee) * limit
    level = knee * limit + rest * (1.0 - np.exp(-beyond / rest))
    return level if x > 0.0 else -level


LAW = Law(
    effect="saturation",
    strength="span_over_limit",
    others={"knee": (0.9, 0.97), "span": _SPAN},
    largest={HPV41: 2.0, EFC: 1.35, SP08: 3.0, AXIS: 6.0},
    equation=equation,
    at=slots.DRIVE,
    full_sigma={AXIS: (1000.0, 5000.0)},  # a force adds up in a position: a few newtons
)
