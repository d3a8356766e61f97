"""Pilot oil is limited: the spool's speed runs into it softly, y = x/(1 + |x/R|^p)^(1/p).

The strength is a reference speed over the limit R.
"""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import HPV41, SP08, Law, Shared

_REFERENCE = {HPV41: 500.0, SP08: 2000.0}


def equation(x: float, a: float, b: float, r: Any) -> float:
    share, power, reference = r.p[0], r.p[1], r.p[2]
    return x / (1.0 + abs(share * x / reference) ** power) ** (1.0 / power)


LAW = Law(
    effect="rate_limit",
    strength="reference_over_limit",
    others={"sharpness": (6.0, 14.0), "reference_speed": _REFERENCE},
    largest={HPV41: 12.0, SP08: 25.0},
    equation=equation,
    at=slots.RATE,
    shared=(Shared("limit", "%/s", lambda p: p[2] / p[0]),),
)
