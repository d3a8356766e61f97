"""Not on any list: a burr at one opening; gain is higher there and nowhere else."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import EFC, HPV41, SP08, Law

_PLACE = {HPV41: (35.0, 65.0), EFC: (1.52, 1.64), SP08: (10.0, 35.0)}
_WIDTH = {HPV41: 5.0, EFC: 0.02, SP08: 5.0}


def equation(x: float, a: float, b: float, r: Any) -> float:
    return x * (1.0 + r.p[0] * np.exp(-(((a - r.p[1]) / r.p[2]) ** 2)))


def draw(rng: np.random.Generator, plant: str) -> tuple[float, ...]:
    return rng.uniform(*_PLACE[plant]), _WIDTH[plant] * rng.uniform(0.8, 1.5)


LAW = Law(
    effect="gain_bump",
    listed=False,
    meaning=("strength", "place", "width"),
    largest={HPV41: 1.0, EFC: 1.0, SP08: 2.0},
    draw=draw,
    equation=equation,
    slot={HPV41: slots.FLOW, EFC: slots.FLOW, SP08: slots.FLOW},
)
