"""A wiper of the guide that is pushed into its groove one way and drags along the other; the change-over is smooth."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import AXIS, Law


def equation(x: float, a: float, b: float, r: Any) -> float:
    return x * (1.0 + r.p[0] * 0.5 * (1.0 - np.tanh(b / r.p[1])))


def draw(rng: np.random.Generator, plant: str) -> tuple[float, ...]:
    return (rng.uniform(0.005, 0.03),)


LAW = Law(
    effect="asymmetry",
    meaning=("more_drag_backwards", "transition"),
    largest={AXIS: 2.0},
    draw=draw,
    equation=equation,
    slot={AXIS: slots.VISCOSITY},
    full_sigma={AXIS: (1000.0, 5000.0)},  # a force adds up in a position: a few newtons
)
