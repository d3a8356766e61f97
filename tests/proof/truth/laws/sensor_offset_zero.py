"""The zero of the flow meter has shifted."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import HPV41, Law, Shared


def equation(x: float, a: float, b: float, r: Any) -> float:
    return x + r.p[0]


def draw(rng: np.random.Generator, plant: str) -> tuple[float, ...]:
    return ()


LAW = Law(
    effect="sensor_offset",
    meaning=("offset",),
    largest={HPV41: 10.0},
    draw=draw,
    equation=equation,
    slot={HPV41: slots.READING},
    shared=(Shared("offset", "l/min", lambda p: p[0]),),
)
