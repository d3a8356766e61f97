"""Not on any list: a loose connector divides the sensor's signal for a while, again and again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..law import EFC, HPV41, SP08, Array, Law
from ..spells import spells


def after(values: Array, sample_s: float, p: Sequence[float], rng: np.random.Generator) -> Array:
    seen = values.copy()
    for gap in spells(len(values), sample_s, p[1], p[2], rng):
        seen[gap] *= 1.0 - p[0]
    return seen


LAW = Law(
    effect="loose_connector",
    listed=False,
    strength="signal_lost",
    others={"every_s": (3.0, 8.0), "lasting_s": (0.2, 1.0)},
    largest={HPV41: 0.9, EFC: 0.6, SP08: 0.1},
    after=after,
    predictable=False,
)
