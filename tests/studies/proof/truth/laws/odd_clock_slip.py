"""Not on any list: the recorder's clock runs slow, so that its time stamps slip against the command."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..law import EFC, HPV41, SP08, Array, Law


def after(values: Array, sample_s: float, p: Sequence[float], rng: np.random.Generator) -> Array:
    at = np.arange(len(values), dtype=float)
    return np.interp(at * (1.0 - p[0]), at, values)


LAW = Law(
    effect="clock_slip",
    listed=False,
    strength="slip",
    largest={HPV41: 4e-3, EFC: 4e-3, SP08: 8e-3},
    after=after,
)
