"""Saturation with a rounded knee: y = x/(1 + |x/L|^p)^(1/p). The strength is the drive's span over the limit L."""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import AXIS, EFC, HPV41, SP08, Law

_SPAN = {HPV41: 100.0, EFC: 2.1, SP08: 100.0, AXIS: 200.0}


def equation(x: float, a: float, b: float, r: Any) -> float:
    share, power, span = r.p[0], r.p[1], r.p[2]
    return x / (1.0 + abs(share * x / span) ** power) ** (1.0 / power)


LAW = Law(
    effect="saturation",
    strength="span_over_limit",
    others={"sharpness": (10.0, 24.0), "span": _SPAN},
    largest={HPV41: 2.0, EFC: 1.35, SP08: 3.0, AXIS: 6.0},
    equation=equation,
    at=slots.DRIVE,
    full_sigma={AXIS: (1000.0, 5000.0)},  # a force adds up in a position: a few newtons
)
