"""Laminar leakage past two spool lands, inversely to the length of overlap that is left; one land more worn.

f(l) = e/(e + max(l, 0)), net flow s·(f(d − x) − ρ·f(d + x))
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..law import HPV41, SP08, Law


def equation(x: float, a: float, b: float, r: Any) -> float:
    strength, overlap, entrance, wear = r.p[0], r.p[1], r.p[2], r.p[3]
    near = entrance / (entrance + max(overlap - a, 0.0))
    far = entrance / (entrance + max(overlap + a, 0.0))
    return x + strength * (near - wear * far)


_OVERLAP = {HPV41: 20.0, SP08: 2.0}


def draw(rng: np.random.Generator, plant: str) -> tuple[float, ...]:
    return _OVERLAP[plant], rng.uniform(15.0, 40.0), rng.uniform(0.0, 0.3)


LAW = Law(
    effect="leakage",
    meaning=("strength", "overlap", "entrance", "wear_of_other_land"),
    largest={HPV41: 8.0, SP08: 30.0},
    draw=draw,
    equation=equation,
    slot={HPV41: slots.FLOW, SP08: slots.FLOW},
)
