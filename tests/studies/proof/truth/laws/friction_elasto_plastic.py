"""Elasto-plastic bristle friction: truly elastic before it slides (Dupont et al., IEEE TAC 47(5), 2002).

ż = v·(1 − α(z, v)·z/z_ss), F = σ0·z; α is 0 below the break-away deflection, 1 at sliding, smooth between.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import AXIS, EFC, HPV41, SP08, Law, Times


def equation(x: float, a: float, b: float, r: Any) -> float:
    coulomb, ratio, stribeck_speed, bristle, elastic = r.p[0], r.p[1], r.p[2], r.p[3], r.p[4]
    if coulomb <= 0.0:
        return x
    z = r.z[0]
    sliding = bristle * (1.0 + (ratio - 1.0) / (1.0 + (b / stribeck_speed) ** 2))
    breakaway = elastic * sliding
    alpha = 0.0
    if z * b > 0.0 and abs(z) >= breakaway:
        alpha = 1.0
        if abs(z) < sliding:
            alpha = 0.5 + 0.5 * np.sin(np.pi * (abs(z) - 0.5 * (sliding + breakaway)) / (sliding - breakaway))
    r.dz[0] = b * (1.0 - alpha * abs(z) / sliding)
    return x - coulomb / bristle * z


_BRISTLE = {HPV41: 0.08, EFC: 0.0015, SP08: 0.6, AXIS: 5e-5}
_STRIBECK_SPEED = {HPV41: 6.0, EFC: 0.2, SP08: 20.0, AXIS: 0.008}


LAW = Law(
    effect="friction",
    strength="coulomb",
    others={
        "static_over_coulomb": (1.1, 1.5),
        "stribeck_speed": Times(_STRIBECK_SPEED, 0.7, 1.4),
        "bristle_deflection": Times(_BRISTLE, 0.9, 1.3),
        "elastic_share": (0.3, 0.7),
    },
    largest={HPV41: 10.0, EFC: 0.08, SP08: 12.0, AXIS: 60.0},
    equation=equation,
    at=slots.FORCE,
    full_sigma={AXIS: (1000.0, 5000.0)},  # a force adds up in a position: a few newtons
)
