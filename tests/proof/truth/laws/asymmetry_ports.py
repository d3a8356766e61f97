"""One port of the valve lets through less than the other; the change-over is smooth."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import HPV41, Law


def equation(x: float, a: float, b: float, r: Any) -> float:
    return x * (1.0 - r.p[0] * 0.5 * (1.0 - np.tanh(a / r.p[1])))


def draw(rng: np.random.Generator, plant: str) -> tuple[float, ...]:
    return (rng.uniform(2.0, 6.0),)


LAW = Law(
    effect="asymmetry",
    meaning=("loss_on_negative_side", "transition"),
    largest={HPV41: 0.6},
    draw=draw,
    equation=equation,
    slot={HPV41: slots.FLOW},
)
