"""Coil inductance that falls as the iron saturates, with an eddy-current branch that passes part at once.

ẏ = (x − y)/τ(y), τ = s/(1 + ½·(y/Y)²), output (1 − e)·y + e·x
"""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import AXIS, EFC, HPV41, SP08, Law

_FULL = {HPV41: 100.0, EFC: 2.0, SP08: 100.0, AXIS: 200.0}


def equation(x: float, a: float, b: float, r: Any) -> float:
    lag, eddy, full = r.p[0], r.p[1], r.p[2]
    if r.m[0] == 0.0 and r.first == 1:
        r.m[0], r.m[1] = 1.0, x
    if lag < 2.0 * r.h:
        return x
    current = r.m[1] + r.z[0]
    r.dz[0] = (x - current) * (1.0 + 0.5 * (current / full) ** 2) / lag
    return (1.0 - eddy) * current + eddy * x


LAW = Law(
    effect="coil_lag",
    strength="lag_s",
    others={"eddy_share": (0.0, 0.12), "full": _FULL},
    largest={HPV41: 0.15, EFC: 0.1, SP08: 0.15, AXIS: 0.1},
    equation=equation,
    at=slots.DRIVE,
    counterparts=("coil_lag",),
)
