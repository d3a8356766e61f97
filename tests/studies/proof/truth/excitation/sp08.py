"""SP08-47C: slow triangle, sine of 1 rad/s, frequency response, random steps, all as requested positions."""

from __future__ import annotations

import math

import numpy as np

from ..law import Array
from .shapes import ramps, sine, stepped_sine, steps, triangle

_TONES = [(f, max(4, math.ceil(4.0 * f))) for f in (0.1, 0.2, 0.4, 0.7, 1.0, 1.5, 2.2)]


def play(rng: np.random.Generator) -> tuple[dict[str, Array], dict[str, Array], dict[str, Array]]:
    """Draw healthy, changed and unseen requests [mm]."""
    unseen = {
        "sine-2rad": sine(115.0, rng.uniform(35.0, 50.0), 2.0 / (2.0 * np.pi), 8.0 * np.pi),
        "ramps-and-steps": np.concatenate(
            [ramps(rng, 65.0, 187.0, (0.5, 4.0), 20.0), steps(rng, 65.0, 187.0, (0.8, 3.0), 20.0)]
        ),
    }
    return _four(rng), _four(rng), unseen


def _four(rng: np.random.Generator) -> dict[str, Array]:
    return {
        "frequency-response": stepped_sine(125.0, rng.choice([10.0, 15.0, 20.0]), _TONES),
        "sine-1rad": sine(125.0, 60.0, 1.0 / (2.0 * np.pi), 16.0 * np.pi),
        "slow-triangle": triangle(125.0, 60.0, 40.0, 2.0),
        "steps": steps(rng, 65.0, 187.0, (1.5, 4.0), 60.0),
    }
