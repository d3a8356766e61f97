"""The zero of the flow meter has shifted."""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import HPV41, Law, Shared


def equation(x: float, a: float, b: float, r: Any) -> float:
    return x + r.p[0]


LAW = Law(
    effect="sensor_offset",
    strength="offset",
    largest={HPV41: 10.0},
    equation=equation,
    at=slots.READING,
    shared=(Shared("offset", "l/min", lambda p: p[0]),),
)
