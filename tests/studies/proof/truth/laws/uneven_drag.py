"""A wiper of the guide that is pushed into its groove one way and drags along the other; the change-over is smooth."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import AXIS, Law


def equation(x: float, a: float, b: float, r: Any) -> float:
    return x * (1.0 + r.p[0] * 0.5 * (1.0 - np.tanh(b / r.p[1])))


LAW = Law(
    effect="asymmetry",
    strength="more_drag_backwards",
    others={"transition": (0.005, 0.03)},
    largest={AXIS: 2.0},
    equation=equation,
    at=slots.VISCOSITY,
    full_sigma={AXIS: (1000.0, 5000.0)},  # a force adds up in a position: a few newtons
)
