"""Magnetic hysteresis as a stack of relays (Preisach 1935): 60 centres × 16 widths.

y = x + s·(mean of the relays − mean of the same relays without width): the loop alone, no static change of gain.
"""

from __future__ import annotations

from typing import Any

from .. import slots
from ..law import EFC, HPV41, SP08, Law, Times

CENTRES, WIDTHS = 60, 16


def equation(x: float, a: float, b: float, r: Any) -> float:
    strength, middle, reach, width = r.p[0], r.p[1], r.p[2], r.p[3]
    first_time = r.m[0] == 0.0
    if r.first == 1 and (first_time or abs(x - r.m[1]) > 1e-4 * reach):
        r.m[0], r.m[1] = 1.0, x
        total = 0.0
        for i in range(CENTRES):
            share = (i + 0.5) / CENTRES
            centre = middle + reach * (1.5 * share - 0.75 + (share - 0.5) ** 3)
            for j in range(WIDTHS):
                half = width * (0.3 + 1.4 * j / (WIDTHS - 1))
                k = 4 + i * WIDTHS + j
                if first_time:
                    r.m[k] = 1.0 if x > centre else -1.0
                elif x > centre + half:
                    r.m[k] = 1.0
                elif x < centre - half:
                    r.m[k] = -1.0
                total += r.m[k] - (1.0 if x > centre else -1.0)
        r.m[2] = total / (CENTRES * WIDTHS)
    return x + strength * r.m[2]


_MIDDLE = {HPV41: 0.0, EFC: 1.5, SP08: 0.0}
_REACH = {HPV41: 120.0, EFC: 0.7, SP08: 110.0}


LAW = Law(
    effect="hysteresis",
    strength="strength",
    others={"middle": _MIDDLE, "reach": Times(_REACH, 0.9, 1.2), "half_width": Times(_REACH, 0.02, 0.05)},
    largest={HPV41: 200.0, EFC: 1.2, SP08: 200.0},
    equation=equation,
    at=slots.DRIVE,
)
