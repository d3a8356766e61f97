"""A further dead time, as a line of remembered values.

A held command is delayed by taking its mean over the delayed step, a continuous one by interpolation.
"""

from __future__ import annotations

from typing import Any

from .. import slots
from ..delay_line import between, remember
from ..law import AXIS, EFC, HPV41, SP08, Law, Shared

_HELD = {HPV41: 1.0, EFC: 1.0, SP08: 0.0, AXIS: 1.0}


def equation(x: float, a: float, b: float, r: Any) -> float:
    remember(r, x)
    since = 0.0 if r.p[1] == 1.0 else r.t - r.m[1]
    return between(r, (r.p[0] - since) / r.h, x)


LAW = Law(
    effect="dead_time",
    strength="dead_time_s",
    others={"held": _HELD},
    largest={HPV41: 0.12, EFC: 0.06, SP08: 0.12, AXIS: 0.1},
    equation=equation,
    at=slots.DRIVE,
    counterparts=("dead_time",),
    shared=(Shared("dead time beyond the baseline's", "s", lambda p: p[0]),),
)
