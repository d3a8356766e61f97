"""Not on any list: a burr at one opening; gain is higher there and nowhere else."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import EFC, HPV41, SP08, Law, Times

_PLACE = {HPV41: (35.0, 65.0), EFC: (1.52, 1.64), SP08: (10.0, 35.0)}
_WIDTH = {HPV41: 5.0, EFC: 0.02, SP08: 5.0}


def equation(x: float, a: float, b: float, r: Any) -> float:
    return x * (1.0 + r.p[0] * np.exp(-(((a - r.p[1]) / r.p[2]) ** 2)))


LAW = Law(
    effect="gain_bump",
    listed=False,
    strength="strength",
    others={"place": _PLACE, "width": Times(_WIDTH, 0.8, 1.5)},
    largest={HPV41: 1.0, EFC: 1.0, SP08: 2.0},
    equation=equation,
    at=slots.FLOW,
)
