"""A transducer with inertia: second order, its lag 2ζ/ω as strength."""

from __future__ import annotations

from typing import Any

import numpy as np

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


def draw(rng: np.random.Generator, plant: str) -> tuple[float, ...]:
    return (rng.uniform(0.8, 1.2),)


LAW = Law(
    effect="sensor_lag",
    meaning=("lag_s", "damping"),
    largest={EFC: 0.08, SP08: 0.15, AXIS: 0.1},
    draw=draw,
    equation=equation,
    slot={EFC: slots.SENSOR, SP08: slots.SENSOR, AXIS: slots.SENSOR},
    counterparts=("sensor_lag",),
    shared=(Shared("lag", "s", lambda p: p[0]),),
)
