"""A lightly damped mode that takes part in the output: y = x + s·(η − x), η̈ + 2ζω·η̇ + ω²·η = ω²·x."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import AXIS, EFC, HPV41, SP08, Law, Shared


def equation(x: float, a: float, b: float, r: Any) -> float:
    share, frequency, damping = r.p[0], r.p[1], r.p[2]
    if r.m[0] == 0.0 and r.first == 1:
        r.m[0], r.m[1] = 1.0, x
    r.dz[0] = r.z[1]
    mode = r.m[1] + r.z[0]
    r.dz[1] = frequency * frequency * (x - mode) - 2.0 * damping * frequency * r.z[1]
    return x + share * (mode - x)


_RAD_S = {HPV41: (25.0, 70.0), EFC: (70.0, 160.0), SP08: (15.0, 50.0), AXIS: (40.0, 90.0)}


LAW = Law(
    effect="resonance",
    strength="share",
    others={"frequency_rad_s": _RAD_S, "damping": (0.03, 0.15)},
    largest={HPV41: 1.0, EFC: 1.0, SP08: 1.0, AXIS: 1.0},
    equation=equation,
    at=slots.OUTPUT,
    shared=(
        Shared("frequency", "rad/s", lambda p: p[1]),
        Shared("frequency", "Hz", lambda p: p[1] / (2.0 * np.pi)),
    ),
)
