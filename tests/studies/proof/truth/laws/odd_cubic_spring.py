"""Not on any list: a centring spring that stiffens with the cube of the stroke."""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import AXIS, HPV41, SP08, Law

_REACH = {HPV41: 100.0, SP08: 100.0, AXIS: 0.1}
_FORCE = {HPV41: 100.0, SP08: 100.0, AXIS: 100.0}


def equation(x: float, a: float, b: float, r: Any) -> float:
    return x - r.p[0] * r.p[2] * (a / r.p[1]) ** 3.0


LAW = Law(
    effect="cubic_spring",
    listed=False,
    strength="strength",
    others={"reach": _REACH, "force_at_reach": _FORCE},
    largest={HPV41: 1.0, SP08: 2.0, AXIS: 1.0},
    equation=equation,
    at=slots.FORCE,
    full_sigma={AXIS: (1000.0, 5000.0)},  # a force adds up in a position: a few newtons
)
