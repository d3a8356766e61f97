"""Not on any list: something knocks against the moving part now and then."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import slots
from ..chance import chance
from ..law import EFC, HPV41, SP08, Law
from ..memory import KEY


def equation(x: float, a: float, b: float, r: Any) -> float:
    size, every_s, lasting_s = r.p[0], r.p[1], r.p[2]
    if r.t < 0.0:
        return x
    count = np.floor(r.t / every_s)
    since = r.t - count * every_s - 0.8 * every_s * chance(r.p[KEY] + 211.0, count)
    if since < 0.0 or since > lasting_s or chance(r.p[KEY] + 223.0, count) > 0.7:
        return x
    direction = 1.0 if chance(r.p[KEY] + 227.0, count) > 0.5 else -1.0
    return x + direction * size * np.sin(np.pi * since / lasting_s)


LAW = Law(
    effect="knocked_spool",
    listed=False,
    strength="size",
    others={"every_s": (1.0, 3.0), "lasting_s": (0.02, 0.06)},
    largest={HPV41: 300.0, EFC: 3.0, SP08: 600.0},
    equation=equation,
    at=slots.FORCE,
    predictable=False,
)
