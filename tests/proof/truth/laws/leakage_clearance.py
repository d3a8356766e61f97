"""Leakage through the closed clearance, driven by what pressure difference is left, less with more overlap."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import EFC, Law


def equation(x: float, a: float, b: float, r: Any) -> float:
    strength, edge, length, supply = r.p[0], r.p[1], r.p[2], r.p[3]
    return x + strength * (1.0 - x / supply) * length / (length + max(edge - a, 0.0))


def draw(rng: np.random.Generator, plant: str) -> tuple[float, ...]:
    return rng.uniform(1.3, 1.5), rng.uniform(1.0, 3.0), rng.uniform(215.0, 230.0)


LAW = Law(
    effect="leakage",
    meaning=("strength_psi", "edge_a", "length_a", "supply_psi"),
    largest={EFC: 30.0},
    draw=draw,
    equation=equation,
    slot={EFC: slots.FLOW},
)
