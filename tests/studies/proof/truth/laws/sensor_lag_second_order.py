"""A transducer with inertia: second order, its lag 2ζ/ω as strength."""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import AXIS, EFC, SP08, Law, Shared


def equation(x: float, a: float, b: float, r: Any) -> float:
    lag, damping = r.p[0], r.p[1]
    if r.m[0] == 0.0 and r.first == 1:
        r.m[0], r.m[1] = 1.0, x
    if lag < 4.0 * r.h:
        return x
    frequency = 2.0 * damping / lag
    r.dz[0] = r.z[1]
    r.dz[1] = frequency * frequency * (x - r.m[1] - r.z[0]) - 2.0 * damping * frequency * r.z[1]
    return r.m[1] + r.z[0]


LAW = Law(
    effect="sensor_lag",
    strength="lag_s",
    others={"damping": (0.8, 1.2)},
    largest={EFC: 0.08, SP08: 0.15, AXIS: 0.1},
    equation=equation,
    at=slots.SENSOR,
    counterparts=("sensor_lag",),
    shared=(Shared("lag", "s", lambda p: p[0]),),
)
