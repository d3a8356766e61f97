"""One port of the valve lets through less than the other; the change-over is smooth."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import HPV41, Law


def equation(x: float, a: float, b: float, r: Any) -> float:
    return x * (1.0 - r.p[0] * 0.5 * (1.0 - np.tanh(a / r.p[1])))


LAW = Law(
    effect="asymmetry",
    strength="loss_on_negative_side",
    others={"transition": (2.0, 6.0)},
    largest={HPV41: 0.6},
    equation=equation,
    at=slots.FLOW,
)
