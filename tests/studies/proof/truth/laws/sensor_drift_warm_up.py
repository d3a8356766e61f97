"""A sensor that warms up: exponential, with a little random walk on top; begins anew with each recording."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..chance import chance
from ..law import EFC, HPV41, Law
from ..memory import KEY


def equation(x: float, a: float, b: float, r: Any) -> float:
    size, time_s, walk = r.p[0], r.p[1], r.p[2]
    if r.t <= 0.0:
        return x
    second = np.floor(r.t)
    if r.first == 1 and second >= r.m[0]:
        r.m[0] = second + 1.0
        r.m[1] = r.m[2]
        r.m[2] += chance(r.p[KEY] + 17.0, second) - 0.5
    wander = r.m[1] + (r.m[2] - r.m[1]) * (r.t - second)
    return x + size * (1.0 - np.exp(-r.t / time_s) + walk * wander)


LAW = Law(
    effect="sensor_drift",
    strength="size",
    others={"time_s": (5.0, 40.0), "random_walk_share": (0.0, 0.03)},
    largest={HPV41: 10.0, EFC: 20.0},
    equation=equation,
    at=slots.READING,
)
