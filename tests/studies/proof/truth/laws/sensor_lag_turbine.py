"""Turbine flow meter: the rotor speeds up in proportion to flow times slip, slower at small flow.

ẏ = (x − y)·(κ + |y|/Q)/τ, and faster up than down.
"""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import HPV41, Law


def equation(x: float, a: float, b: float, r: Any) -> float:
    lag, floor, slower_down, full = r.p[0], r.p[1], r.p[2], r.p[3]
    if r.m[0] == 0.0 and r.first == 1:
        r.m[0], r.m[1] = 1.0, x
    if lag < 2.0 * r.h:
        return x
    y = r.m[1] + r.z[0]
    rate = (floor + (1.0 - floor) * min(1.0, abs(y) / full)) / lag
    if (x - y) * y < 0.0:
        rate /= slower_down
    r.dz[0] = (x - y) * rate
    return y


LAW = Law(
    effect="sensor_lag",
    strength="lag_at_full_flow_s",
    others={"rate_at_rest": (0.4, 0.7), "slower_down": (1.1, 1.5), "full_flow": 70.0},
    largest={HPV41: 0.3},
    equation=equation,
    at=slots.SENSOR,
    counterparts=("meter_lag",),
)
