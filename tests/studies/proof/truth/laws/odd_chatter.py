"""Not on any list: the valve chatters, but only while it is open by a certain amount."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import EFC, HPV41, Law, Times

_PLACE = {HPV41: (35.0, 65.0), EFC: (1.5, 1.66)}
_WIDTH = {HPV41: 10.0, EFC: 0.04}


def equation(x: float, a: float, b: float, r: Any) -> float:
    size, place, width, frequency = r.p[0], r.p[1], r.p[2], r.p[3]
    return x + size * np.exp(-(((a - place) / width) ** 2)) * np.sin(2.0 * np.pi * frequency * r.t)


LAW = Law(
    effect="chatter",
    listed=False,
    strength="size",
    others={"place": _PLACE, "width": Times(_WIDTH, 0.8, 1.3), "frequency_hz": (8.0, 30.0)},
    largest={HPV41: 20.0, EFC: 40.0},
    equation=equation,
    at=slots.OUTPUT,
)
