"""Not on any list: another consumer on the same supply switches on and off at chance times."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..chance import chance
from ..law import EFC, HPV41, SP08, Law
from ..memory import KEY


def equation(x: float, a: float, b: float, r: Any) -> float:
    depth, dwell_s, time_s = r.p[0], r.p[1], r.p[2]
    taking = 0.0
    if r.t >= 0.0:
        taking = 1.0 if chance(r.p[KEY] + 101.0, np.floor(r.t / dwell_s)) > 0.5 else 0.0
    r.dz[0] = (taking - r.z[0]) / time_s
    return x * (1.0 - depth * r.z[0])


LAW = Law(
    effect="second_consumer",
    listed=False,
    strength="pressure_taken",
    others={"dwell_s": (0.7, 3.0), "time_s": (0.03, 0.15)},
    largest={HPV41: 0.7, EFC: 0.5, SP08: 0.9},
    equation=equation,
    at=slots.SUPPLY,
    predictable=False,
)
