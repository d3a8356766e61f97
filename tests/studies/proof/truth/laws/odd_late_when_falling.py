"""Not on any list: software that passes rising commands at once and falling ones late."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..law import EFC, HPV41, SP08, Array, Law


def _highest_of_last(values: Array, count: int) -> Array:
    padded = np.concatenate([np.full(count, values[0]), values])
    return np.lib.stride_tricks.sliding_window_view(padded, count + 1).max(axis=1)


def before(command: Array, sample_s: float, p: Sequence[float], rng: np.random.Generator) -> Array:
    samples = p[0] / sample_s
    whole = int(samples)
    share = samples - whole
    return (1.0 - share) * _highest_of_last(command, whole) + share * _highest_of_last(command, whole + 1)


LAW = Law(
    effect="late_when_falling",
    listed=False,
    strength="late_s",
    largest={HPV41: 0.3, EFC: 0.15, SP08: 0.5},
    before=before,
)
