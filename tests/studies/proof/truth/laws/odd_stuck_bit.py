"""Not on any list: one bit of the command's converter always reads 0."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..law import EFC, HPV41, SP08, Array, Law


def before(command: Array, sample_s: float, p: Sequence[float], rng: np.random.Generator) -> Array:
    weight = p[0]
    if weight <= 0.0:
        return command
    return command - weight * (np.floor(np.abs(command) / weight) % 2.0) * np.sign(command)


LAW = Law(
    effect="stuck_bit",
    listed=False,
    strength="weight_of_bit",
    largest={HPV41: 12.0, EFC: 0.08, SP08: 8.0},
    before=before,
)
