"""Chance spells in time, for links that drop out and connectors that work loose."""

from __future__ import annotations

import numpy as np


def spells(samples: int, sample_s: float, every_s: float, lasting_s: float, rng: np.random.Generator) -> list[slice]:
    """Return stretches of samples, one in each interval `every_s`, of 0.5…1.5 × lasting_s."""
    found = []
    for start_s in np.arange(0.0, samples * sample_s - every_s, every_s):
        begin = start_s + rng.uniform(0.0, 0.5) * every_s
        length = min(lasting_s * rng.uniform(0.5, 1.5), 0.5 * every_s)
        first, last = int(begin / sample_s), int((begin + length) / sample_s)
        if last > first:
            found.append(slice(max(first, 1), last))
    return found
