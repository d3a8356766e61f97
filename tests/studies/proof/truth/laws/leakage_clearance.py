"""Leakage through the closed clearance, driven by what pressure difference is left, less with more overlap."""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import EFC, Law


def equation(x: float, a: float, b: float, r: Any) -> float:
    strength, edge, length, supply = r.p[0], r.p[1], r.p[2], r.p[3]
    return x + strength * (1.0 - x / supply) * length / (length + max(edge - a, 0.0))


LAW = Law(
    effect="leakage",
    strength="strength_psi",
    others={"edge_a": (1.3, 1.5), "length_a": (1.0, 3.0), "supply_psi": (215.0, 230.0)},
    largest={EFC: 30.0},
    equation=equation,
    at=slots.FLOW,
)
