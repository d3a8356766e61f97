"""Not on any list: the gain swings slowly to and fro, as with a supply regulator that hunts."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import EFC, HPV41, SP08, Law


def equation(x: float, a: float, b: float, r: Any) -> float:
    return x * (1.0 + r.p[0] * np.sin(2.0 * np.pi * r.t / r.p[1] + r.p[2]))


LAW = Law(
    effect="gain_modulation",
    listed=False,
    strength="depth",
    others={"period_s": (2.0, 15.0), "phase_rad": (0.0, 6.28)},
    largest={HPV41: 0.6, EFC: 0.4, SP08: 0.95},
    equation=equation,
    at=slots.OUTPUT,
)
