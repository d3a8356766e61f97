"""Not on any list: the gain swings slowly to and fro, as with a supply regulator that hunts."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import EFC, HPV41, SP08, Law


def equation(x: float, a: float, b: float, r: Any) -> float:
    return x * (1.0 + r.p[0] * np.sin(2.0 * np.pi * r.t / r.p[1] + r.p[2]))


def draw(rng: np.random.Generator, plant: str) -> tuple[float, ...]:
    return rng.uniform(2.0, 15.0), rng.uniform(0.0, 6.28)


LAW = Law(
    effect="gain_modulation",
    listed=False,
    meaning=("depth", "period_s", "phase_rad"),
    largest={HPV41: 0.6, EFC: 0.4, SP08: 0.95},
    draw=draw,
    equation=equation,
    slot={HPV41: slots.OUTPUT, EFC: slots.OUTPUT, SP08: slots.OUTPUT},
)
