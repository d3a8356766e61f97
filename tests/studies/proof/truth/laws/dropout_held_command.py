"""Commands are lost on their way: the valve stays on the last one while the recording shows the new."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..law import EFC, HPV41, SP08, Array, Law
from ..spells import spells


def before(command: Array, sample_s: float, p: Sequence[float], rng: np.random.Generator) -> Array:
    held = command.copy()
    for gap in spells(len(command), sample_s, p[1], p[0], rng):
        held[gap] = held[gap.start - 1]
    return held


LAW = Law(
    effect="dropout",
    strength="lasting_s",
    others={"every_s": (1.5, 4.0)},
    largest={HPV41: 1.5, EFC: 1.0, SP08: 1.5},
    before=before,
    predictable=False,
)
