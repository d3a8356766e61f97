"""Maxwell-slip friction: four spring-slider elements in parallel, each with its own break-away (Iwan 1966).

Element i carries k_i·z_i up to its share w_i of the friction force, which weakens with speed.
"""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import AXIS, EFC, HPV41, SP08, Law, Times


def equation(x: float, a: float, b: float, r: Any) -> float:
    coulomb, ratio, stribeck_speed, deflection, spread = r.p[0], r.p[1], r.p[2], r.p[3], r.p[4]
    level = 1.0 + (ratio - 1.0) / (1.0 + abs(b) / stribeck_speed)
    force = 0.0
    for i in range(4):
        reach = deflection * (1.0 + spread * (i - 1.5))
        z = r.m[i]
        if r.first == 1:  # elements follow step by step, as sliders do
            z = min(max(z + b * r.h, -reach * level), reach * level)
            r.m[i] = z
        force += 0.25 * z / reach
    return x - coulomb * force


_DEFLECTION = {HPV41: 0.15, EFC: 0.002, SP08: 0.8, AXIS: 6e-5}
_STRIBECK_SPEED = {HPV41: 8.0, EFC: 0.25, SP08: 25.0, AXIS: 0.01}


LAW = Law(
    effect="friction",
    strength="coulomb",
    others={
        "static_over_coulomb": (1.1, 1.5),
        "stribeck_speed": Times(_STRIBECK_SPEED, 0.7, 1.4),
        "deflection": Times(_DEFLECTION, 0.8, 1.2),
        "spread_of_elements": (0.2, 0.5),
    },
    largest={HPV41: 10.0, EFC: 0.08, SP08: 12.0, AXIS: 60.0},
    equation=equation,
    at=slots.FORCE,
    full_sigma={AXIS: (1000.0, 5000.0)},  # a force adds up in a position: a few newtons
)
