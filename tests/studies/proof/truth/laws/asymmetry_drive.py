"""A motor amplifier whose two half bridges differ in gain."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import AXIS, Law


def equation(x: float, a: float, b: float, r: Any) -> float:
    return x * (1.0 - r.p[0] * 0.5 * (1.0 - np.tanh(x / r.p[1])))


LAW = Law(
    effect="asymmetry",
    strength="loss_on_negative_side",
    others={"transition": (0.5, 3.0)},
    largest={AXIS: 0.3},
    equation=equation,
    at=slots.DRIVE,
    full_sigma={AXIS: (1000.0, 5000.0)},  # a force adds up in a position: a few newtons
)
