"""Linear axis: references of the position loop in which the force is recorded."""

from __future__ import annotations

import numpy as np

from ..law import Array
from ..simulate import SAMPLE_S
from .shapes import ramps, seconds, sine, stepped_sine, steps

_REACH_M = 0.1


def play(rng: np.random.Generator) -> tuple[dict[str, Array], dict[str, Array], dict[str, Array]]:
    """Draw healthy, changed and unseen references [m], all of them at rest at 0 when they start."""
    unseen = {
        "sine": _eased(sine(0.0, rng.uniform(0.05, 0.08), rng.uniform(0.3, 0.7), 30.0)),
        "ramps": _gentle(ramps(rng, -_REACH_M, _REACH_M, (0.4, 2.5), 30.0)),
    }
    return _four(rng), _four(rng), unseen


def _four(rng: np.random.Generator) -> dict[str, Array]:
    return {
        "multisine": _eased(_multisine(rng, 0.08, 60.0)),
        "ramps": _gentle(ramps(rng, -_REACH_M, _REACH_M, (0.5, 4.0), 60.0)),
        "steps": _gentle(steps(rng, -_REACH_M, _REACH_M, (0.8, 3.0), 60.0)),
        "stepped-sine": _eased(stepped_sine(0.0, 0.02, [(f, max(4, round(8 * f))) for f in (0.2, 0.5, 1.0, 1.7, 2.9)])),
    }


def _multisine(rng: np.random.Generator, reach: float, duration_s: float) -> Array:
    t = seconds(duration_s)
    tones = np.arange(1, 30, 2) * 0.1
    summed = np.sin(2.0 * np.pi * np.outer(tones, t) + rng.uniform(0.0, 2.0 * np.pi, len(tones))[:, None])
    wave = (summed / tones[:, None]).sum(axis=0)
    return np.asarray(reach * wave / np.abs(wave).max())


def _eased(reference: Array) -> Array:
    """Begin from rest at 0 within a second."""
    share = np.clip(seconds(len(reference) * SAMPLE_S), 0.0, 1.0)
    return np.asarray(reference * share * share * (3.0 - 2.0 * share))


def _gentle(reference: Array) -> Array:
    """Round the corners to what the axis can follow: three lags of 60 ms."""
    keep = np.exp(-SAMPLE_S / 0.06)
    for _ in range(3):
        state, smooth = 0.0, np.empty_like(reference)
        for i, value in enumerate(reference):
            state += (1.0 - keep) * (value - state)
            smooth[i] = state
        reference = smooth
    return reference
