"""Laminar leakage past two spool lands, inversely to the length of overlap that is left; one land more worn.

f(l) = e/(e + max(l, 0)), net flow s·(f(d − x) − ρ·f(d + x))
"""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import HPV41, SP08, Law


def equation(x: float, a: float, b: float, r: Any) -> float:
    strength, overlap, entrance, wear = r.p[0], r.p[1], r.p[2], r.p[3]
    near = entrance / (entrance + max(overlap - a, 0.0))
    far = entrance / (entrance + max(overlap + a, 0.0))
    return x + strength * (near - wear * far)


_OVERLAP = {HPV41: 20.0, SP08: 2.0}


LAW = Law(
    effect="leakage",
    strength="strength",
    others={"overlap": _OVERLAP, "entrance": (15.0, 40.0), "wear_of_other_land": (0.0, 0.3)},
    largest={HPV41: 8.0, SP08: 30.0},
    equation=equation,
    at=slots.FLOW,
)
