"""Magnetic hysteresis after Jiles and Atherton (J. Magn. Magn. Mater. 61, 1986), without mean-field coupling.

dM/dH = (M_an(H) − M)/(k·sign dH), M_an = coth(h) − 1/h with h = H/a; y = x + s·(M − M_an).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from .. import slots
from ..law import EFC, HPV41, SP08, Law, Times


@njit(inline="always")
def _langevin(h: float) -> float:
    return h / 3.0 if abs(h) < 1e-3 else 1.0 / np.tanh(h) - 1.0 / h


def equation(x: float, a: float, b: float, r: Any) -> float:
    strength, middle, shape, pinning = r.p[0], r.p[1], r.p[2], r.p[3]
    if r.first == 1:
        if r.m[0] == 0.0:
            r.m[0], r.m[1], r.m[2] = 1.0, x, _langevin((x - middle) / shape)
        change = x - r.m[1]
        if change != 0.0:
            steps = 1 + int(abs(change) / (0.1 * pinning))
            part = change / steps
            for i in range(steps):
                field = r.m[1] + (i + 0.5) * part
                lost = np.exp(-abs(part) / pinning)
                r.m[2] = _langevin((field - middle) / shape) * (1.0 - lost) + r.m[2] * lost
            r.m[1] = x
    return x + strength * (r.m[2] - _langevin((r.m[1] - middle) / shape))


_MIDDLE = {HPV41: 0.0, EFC: 1.5, SP08: 0.0}
_SHAPE = {HPV41: 40.0, EFC: 0.25, SP08: 40.0}


LAW = Law(
    effect="hysteresis",
    strength="strength",
    others={"middle": _MIDDLE, "shape": Times(_SHAPE, 0.9, 1.3), "pinning": Times(_SHAPE, 0.08, 0.15)},
    largest={HPV41: 200.0, EFC: 1.2, SP08: 200.0},
    equation=equation,
    at=slots.DRIVE,
)
