"""Overlap with rounded edges, a little wider on one side: y = soft(x − d₊) − soft(−x − d₋)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from .. import slots
from ..law import HPV41, SP08, Law, Shared


@njit(inline="always")
def _soft(u: float, edge: float) -> float:
    if u > 30.0 * edge:
        return u
    return edge * np.log1p(np.exp(u / edge)) if u > -30.0 * edge else 0.0


def equation(x: float, a: float, b: float, r: Any) -> float:
    overlap, uneven, rounding = r.p[0], r.p[1], r.p[2]
    if overlap <= 0.0:
        return x
    edge = rounding * overlap
    return _soft(x - overlap * (1.0 + uneven), edge) - _soft(-x - overlap * (1.0 - uneven), edge)


LAW = Law(
    effect="deadband",
    strength="overlap",
    others={"uneven": (-0.12, 0.12), "rounding": (0.04, 0.12)},
    largest={HPV41: 15.0, SP08: 15.0},
    equation=equation,
    at=slots.METER,
    counterparts=("overlap",),
    shared=(Shared("half width, mean of both sides", "%", lambda p: p[0]),),
)
