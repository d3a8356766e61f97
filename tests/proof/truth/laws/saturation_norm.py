"""Saturation with a rounded knee: y = x/(1 + |x/L|^p)^(1/p). The strength is the drive's span over the limit L."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import AXIS, EFC, HPV41, SP08, Law

_SPAN = {HPV41: 100.0, EFC: 2.1, SP08: 100.0, AXIS: 200.0}


def equation(x: float, a: float, b: float, r: Any) -> float:
    share, power, span = r.p[0], r.p[1], r.p[2]
    return x / (1.0 + abs(share * x / span) ** power) ** (1.0 / power)


def draw(rng: np.random.Generator, plant: str) -> tuple[float, ...]:
    return rng.uniform(10.0, 24.0), _SPAN[plant]


LAW = Law(
    effect="saturation",
    meaning=("span_over_limit", "sharpness", "span"),
    largest={HPV41: 2.0, EFC: 1.35, SP08: 3.0, AXIS: 6.0},
    draw=draw,
    equation=equation,
    slot={HPV41: slots.DRIVE, EFC: slots.DRIVE, SP08: slots.DRIVE, AXIS: slots.DRIVE},
    full_sigma={AXIS: (1000.0, 5000.0)},  # a force adds up in a position: a few newtons
)
