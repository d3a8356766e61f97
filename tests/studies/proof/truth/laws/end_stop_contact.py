"""A part that meets its stop: spring and damper, pushing only. The strength is how far the stop is moved in."""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import AXIS, EFC, HPV41, Law, Shared, Times

_REACH = {HPV41: 101.0, EFC: 2.11, AXIS: 0.11}
_STIFFNESS = {HPV41: 300.0, EFC: 150.0, AXIS: 4e6}  # input units per unit of position
_DAMPING_S = {HPV41: 0.002, EFC: 0.002, AXIS: 0.012}


def equation(x: float, a: float, b: float, r: Any) -> float:
    limit, stiffness, damping_s = r.p[1] - r.p[0], r.p[2], r.p[3]
    deep = abs(a) - limit
    if deep <= 0.0:
        return x
    outward = b if a > 0.0 else -b
    push = stiffness * max(0.0, deep + damping_s * outward)
    return x - push if a > 0.0 else x + push


LAW = Law(
    effect="end_stop",
    strength="moved_in",
    others={"reach": _REACH, "stiffness": Times(_STIFFNESS, 0.8, 1.5), "damping_s": Times(_DAMPING_S, 0.5, 2.0)},
    largest={HPV41: 60.0, EFC: 0.6, AXIS: 0.08},
    equation=equation,
    at=slots.FORCE,
    shared=(
        Shared("position", "%", lambda p: p[1] - p[0], both_ways=True),
        Shared("position", "A", lambda p: p[1] - p[0], both_ways=True),
        Shared("position", "m", lambda p: p[1] - p[0], both_ways=True),
    ),
    full_sigma={AXIS: (1000.0, 5000.0)},  # a force adds up in a position: a few newtons
)
