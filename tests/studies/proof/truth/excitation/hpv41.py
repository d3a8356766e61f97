"""HPV41: flow curve, frequency responses at ±50 %, random steps."""

from __future__ import annotations

import math

import numpy as np

from ..law import Array
from .shapes import ramps, sine, stepped_sine, steps, triangle

_TONES = [(f, max(4, math.ceil(3.0 * f))) for f in (0.1, 0.3, 0.5, 0.9, 1.5, 2.1, 2.9, 3.9, 4.9)]
_AMPLITUDES = (5.0, 10.0, 20.0)


def play(rng: np.random.Generator) -> tuple[dict[str, Array], dict[str, Array], dict[str, Array]]:
    """Draw healthy, changed and unseen commands [%]."""
    negative, positive = rng.permutation(_AMPLITUDES), rng.permutation(_AMPLITUDES)
    unseen = {
        "large-sine": sine(0.0, rng.uniform(80.0, 100.0), rng.choice([0.2, 0.3, 0.5]), 25.0),
        "ramps-and-steps": np.concatenate(
            [ramps(rng, -100.0, 100.0, (0.3, 3.0), 20.0), steps(rng, -100.0, 100.0, (0.3, 2.0), 20.0)]
        ),
    }
    return _four(rng, negative[0], positive[0]), _four(rng, negative[1], positive[1]), unseen


def _four(rng: np.random.Generator, negative: float, positive: float) -> dict[str, Array]:
    return {
        "flow-curve": triangle(0.0, 100.0, 40.0, 2.0),
        f"frequency-response-m50-a{negative:.0f}": stepped_sine(-50.0, negative, _TONES),
        f"frequency-response-p50-a{positive:.0f}": stepped_sine(50.0, positive, _TONES),
        "steps": steps(rng, -100.0, 100.0, (0.5, 3.0), 60.0),
    }
