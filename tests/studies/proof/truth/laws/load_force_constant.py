"""A constant force on the carriage: an inclined axis, or a drive that is not quite at zero."""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import AXIS, Law, Shared


def equation(x: float, a: float, b: float, r: Any) -> float:
    return x - r.p[0]


LAW = Law(
    effect="load_force",
    strength="force_n",
    largest={AXIS: 40.0},
    equation=equation,
    at=slots.FORCE,
    shared=(Shared("force", "N", lambda p: abs(p[0])),),
    full_sigma={AXIS: (3000.0, 30000.0)},  # a constant force adds up most of all
)
