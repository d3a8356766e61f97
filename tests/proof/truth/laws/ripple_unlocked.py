"""The ripple of `ripple.py` at a chance phase in each recording: it can be named, but not predicted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from . import ripple


def draw(rng: np.random.Generator, plant: str) -> tuple[float, ...]:
    return (*ripple.draw(rng, plant)[:-1], 0.0)


LAW = replace(ripple.LAW, draw=draw, predictable=False)
