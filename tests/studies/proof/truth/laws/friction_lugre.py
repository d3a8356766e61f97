"""LuGre bristle friction with Stribeck curve (Canudas de Wit et al., IEEE TAC 40(3), 1995).

ż = v − σ0·|v|·z/g(v), F = σ0·z + σ1·ż, g(v) = Fc + (Fs − Fc)·exp(−(v/vs)²)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import AXIS, EFC, HPV41, SP08, Law, Times


def equation(x: float, a: float, b: float, r: Any) -> float:
    coulomb, ratio, stribeck_speed, bristle, damping = r.p[0], r.p[1], r.p[2], r.p[3], r.p[4]
    if coulomb <= 0.0:
        return x
    level = coulomb * (1.0 + (ratio - 1.0) * np.exp(-((b / stribeck_speed) ** 2)))
    stiffness = coulomb / bristle
    r.dz[0] = b - stiffness * abs(b) * r.z[0] / level
    return x - stiffness * (r.z[0] + damping * r.dz[0])


# bristle deflections are as short as the solver's step allows at the fastest motion of each plant
_BRISTLE = {HPV41: 0.08, EFC: 0.0015, SP08: 0.6, AXIS: 2e-4}
_STRIBECK_SPEED = {HPV41: 8.0, EFC: 0.25, SP08: 25.0, AXIS: 0.01}


LAW = Law(
    effect="friction",
    strength="coulomb",
    others={
        "static_over_coulomb": (1.1, 1.6),
        "stribeck_speed": Times(_STRIBECK_SPEED, 0.7, 1.4),
        "bristle_deflection": Times(_BRISTLE, 0.9, 1.3),
        "bristle_damping_s": (0.0, 5e-4),
    },
    largest={HPV41: 10.0, EFC: 0.08, SP08: 12.0, AXIS: 60.0},
    equation=equation,
    at=slots.FORCE,
    full_sigma={AXIS: (1000.0, 5000.0)},  # a force adds up in a position: a few newtons
)
