"""Free play as contact: a massless, damped part between two stiff faces that are a gap apart.

Inside the gap it stays; a face that touches it takes it along and presses it out again, but never pulls.
"""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import EFC, HPV41, SP08, Law


def equation(x: float, a: float, b: float, r: Any) -> float:
    half_gap, contact_rate = 0.5 * r.p[0], r.p[1]
    if half_gap <= 0.0:
        return x
    if r.m[0] == 0.0 and r.first == 1:
        r.m[0], r.m[1] = 1.0, x  # assembled in the middle of its play
    apart = x - (r.m[1] + r.z[0])
    r.dz[0] = 0.0
    if apart >= half_gap:
        r.dz[0] = max(0.0, a + contact_rate * (apart - half_gap))
    elif apart <= -half_gap:
        r.dz[0] = min(0.0, a + contact_rate * (apart + half_gap))
    return r.m[1] + r.z[0]


LAW = Law(
    effect="backlash",
    strength="gap",
    others={"contact_rate_1_s": (5000.0, 8000.0)},
    largest={HPV41: 15.0, EFC: 0.15, SP08: 25.0},
    equation=equation,
    at=slots.LINK,
)
