"""EFC: current sweep, frequency responses at low and medium current, steps from 1 A."""

from __future__ import annotations

import math

import numpy as np

from ..law import Array
from .shapes import ramps, staircase, stepped_sine, steps, triangle

_TONES = [(f, max(6, math.ceil(2.0 * f))) for f in (0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 11.3, 15.6)]


def play(rng: np.random.Generator) -> tuple[dict[str, Array], dict[str, Array], dict[str, Array]]:
    """Draw healthy, changed and unseen currents [A]."""
    unseen = {
        "frequency-response-high": stepped_sine(1.68, 0.08, _TONES),
        "ramps-and-steps": np.concatenate(
            [ramps(rng, 0.95, 2.1, (0.3, 2.0), 15.0), steps(rng, 0.95, 2.1, (0.2, 1.5), 15.0)]
        ),
    }
    return _four(rng), _four(rng), unseen


def _four(rng: np.random.Generator) -> dict[str, Array]:
    low, medium = rng.choice([0.03, 0.05]), rng.choice([0.08, 0.12])
    levels = rng.permutation([1.2, 1.4, 1.6, 1.8, 2.0])
    return {
        "current-sweep": triangle(1.5, 0.6, 40.0, 1.0),
        "frequency-response-low": stepped_sine(1.4, low, _TONES),
        "frequency-response-medium": stepped_sine(1.58, medium, _TONES),
        "step-response": staircase(1.0, [*levels, *levels[::-1]], 1.0, 1.5),
    }
