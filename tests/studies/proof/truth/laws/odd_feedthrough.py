"""Not on any list: the command leaks electrically into the sensor's cable."""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import EFC, HPV41, Law

_MIDDLE = {HPV41: 0.0, EFC: 1.5}


def equation(x: float, a: float, b: float, r: Any) -> float:
    return x + r.p[0] * (b - r.p[1])


LAW = Law(
    effect="feedthrough",
    listed=False,
    strength="gain",
    others={"middle": _MIDDLE},
    largest={HPV41: 0.3, EFC: 80.0},
    equation=equation,
    at=slots.READING,
)
