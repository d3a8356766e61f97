"""Not on any list: a transducer whose gain remembers how hard it was driven in the last seconds."""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import EFC, HPV41, Law

_FULL = {HPV41: 70.0, EFC: 207.0}


def equation(x: float, a: float, b: float, r: Any) -> float:
    gain, time_s, full = r.p[0], r.p[1], r.p[2]
    r.dz[0] = (abs(x) / full - r.z[0]) / time_s
    return x * (1.0 + gain * (r.z[0] - 0.4))


LAW = Law(
    effect="sensor_memory",
    listed=False,
    strength="gain",
    others={"time_s": (1.0, 5.0), "full": _FULL},
    largest={HPV41: 0.8, EFC: 0.5},
    equation=equation,
    at=slots.SENSOR,
)
