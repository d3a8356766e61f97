"""Not on any list: a command filter that somebody's program switches on and off every few seconds."""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import EFC, HPV41, SP08, Law


def equation(x: float, a: float, b: float, r: Any) -> float:
    lag, every_s = r.p[0], r.p[1]
    if lag < 2.0 * r.h:
        return x
    filtering = r.t > 0.0 and int(r.t / every_s) % 2 == 1
    if filtering:
        r.dz[0] = (x - r.z[0]) / lag
        return r.z[0]
    r.dz[0] = (x - r.z[0]) / max(0.002, 4.0 * r.h)  # off: keeps up, so that it switches without a jump
    return x


LAW = Law(
    effect="switching_filter",
    listed=False,
    strength="lag_s",
    others={"every_s": (1.5, 6.0)},
    largest={HPV41: 0.5, EFC: 0.3, SP08: 0.6},
    equation=equation,
    at=slots.DRIVE,
)
