"""A transport line: most of the dead time pure, the rest spread over four small mixing volumes."""

from __future__ import annotations

from typing import Any

from .. import slots
from ..delay_line import between, remember
from ..law import EFC, HPV41, SP08, Law, Shared

_HELD = {HPV41: 1.0, EFC: 1.0, SP08: 0.0}


def equation(x: float, a: float, b: float, r: Any) -> float:
    if r.m[0] == 0.0 and r.first == 1:
        r.m[2] = x
    remember(r, x)
    mixing = r.p[0] * r.p[1] / 4.0
    if mixing < r.h:
        mixing = 0.0
    since = 0.0 if r.p[2] == 1.0 else r.t - r.m[1]
    value = between(r, (r.p[0] - 4.0 * mixing - since) / r.h, x)
    if mixing > 0.0:
        for i in range(4):
            r.dz[i] = (value - r.m[2] - r.z[i]) / mixing
            value = r.m[2] + r.z[i]
    return value


LAW = Law(
    effect="dead_time",
    strength="mean_delay_s",
    others={"mixed_share": (0.1, 0.3), "held": _HELD},
    largest={HPV41: 0.12, EFC: 0.06, SP08: 0.12},
    equation=equation,
    at=slots.DRIVE,
    counterparts=("dead_time",),
    shared=(Shared("mean delay beyond the baseline's", "s", lambda p: p[0]),),
)
