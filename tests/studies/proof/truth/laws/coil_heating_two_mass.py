"""Copper heats the iron round it: two masses, the force falls with the winding's temperature.

τ1·θ̇1 = i² − (θ1 − θ2), τ2·θ̇2 = (θ1 − θ2) − θ2, i = x/(1 + ½·s·θ1); each recording starts cold.
"""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import EFC, HPV41, SP08, Law

_FULL = {HPV41: 100.0, EFC: 2.0, SP08: 100.0}


def equation(x: float, a: float, b: float, r: Any) -> float:
    loss, winding_s, iron_s, full = r.p[0], r.p[1], r.p[2], r.p[3]
    force = x / (1.0 + 0.5 * loss * r.z[0])
    if r.t > 0.0:
        share = force / full
        r.dz[0] = (share * share - (r.z[0] - r.z[1])) / winding_s
        r.dz[1] = (r.z[0] - 2.0 * r.z[1]) / iron_s
    return force


LAW = Law(
    effect="coil_heating",
    strength="force_loss",
    others={"winding_s": (4.0, 12.0), "iron_s": (40.0, 120.0), "full": _FULL},
    largest={HPV41: 1.0, EFC: 0.5, SP08: 6.0},
    equation=equation,
    at=slots.DRIVE,
)
