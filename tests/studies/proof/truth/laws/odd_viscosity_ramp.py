"""Not on any list: the oil warms up during the recording, so that damping and pilot change with time."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import AXIS, EFC, HPV41, Law


def equation(x: float, a: float, b: float, r: Any) -> float:
    return x * np.exp(r.p[0] * (1.0 - max(0.0, r.t) / r.p[1]))


LAW = Law(
    effect="viscosity_ramp",
    listed=False,
    strength="log_of_ratio_at_start",
    others={"time_to_normal_s": (30.0, 60.0)},
    largest={HPV41: 1.5, EFC: 1.5, AXIS: 0.7},
    equation=equation,
    at=slots.VISCOSITY,
)
