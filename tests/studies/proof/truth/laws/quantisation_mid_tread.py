"""A coarse converter that rounds to the nearest level."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..law import AXIS, EFC, HPV41, SP08, Array, Law, Shared


def after(values: Array, sample_s: float, p: Sequence[float], rng: np.random.Generator) -> Array:
    return values if p[0] <= 0.0 else p[0] * np.round(values / p[0])


LAW = Law(
    effect="quantisation",
    strength="step",
    largest={HPV41: 20.0, EFC: 40.0, SP08: 4.0, AXIS: 0.05},
    after=after,
    predictable=False,
    shared=tuple(Shared("step", unit, lambda p: p[0]) for unit in ("l/min", "psi", "mm", "m")),
)
