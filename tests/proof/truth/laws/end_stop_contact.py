"""A part that meets its stop: spring and damper, pushing only. The strength is how far the stop is moved in."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import AXIS, EFC, HPV41, Law, Shared

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


def draw(rng: np.random.Generator, plant: str) -> tuple[float, ...]:
    return _REACH[plant], _STIFFNESS[plant] * rng.uniform(0.8, 1.5), _DAMPING_S[plant] * rng.uniform(0.5, 2.0)


LAW = Law(
    effect="end_stop",
    meaning=("moved_in", "reach", "stiffness", "damping_s"),
    largest={HPV41: 60.0, EFC: 0.6, AXIS: 0.08},
    draw=draw,
    equation=equation,
    slot={HPV41: slots.FORCE, EFC: slots.FORCE, AXIS: slots.FORCE},
    shared=(
        Shared("position", "%", lambda p: p[1] - p[0], both_ways=True),
        Shared("position", "A", lambda p: p[1] - p[0], both_ways=True),
        Shared("position", "m", lambda p: p[1] - p[0], both_ways=True),
    ),
    full_sigma={AXIS: (1000.0, 5000.0)},  # a force adds up in a position: a few newtons
)
