"""Waveforms at 250 samples a second."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..law import Array
from ..simulate import SAMPLE_S


def seconds(duration_s: float) -> Array:
    """Return sample times."""
    return np.arange(round(duration_s / SAMPLE_S)) * SAMPLE_S


def triangle(middle: float, reach: float, period_s: float, periods: float) -> Array:
    """Return a triangle that starts upwards from the middle."""
    phase = seconds(period_s * periods) / period_s
    return middle + reach * (2.0 / np.pi) * np.arcsin(np.sin(2.0 * np.pi * phase))


def sine(middle: float, amplitude: float, frequency_hz: float, duration_s: float) -> Array:
    """Return a sine that starts upwards from the middle."""
    return middle + amplitude * np.sin(2.0 * np.pi * frequency_hz * seconds(duration_s))


def stepped_sine(middle: float, amplitude: float, tones: Sequence[tuple[float, int]], rest_s: float = 1.0) -> Array:
    """Return a rest, then whole periods of each (frequency, periods)."""
    parts = [np.full(round(rest_s / SAMPLE_S), middle)]
    parts += [sine(middle, amplitude, f, n / f) for f, n in tones]
    return np.concatenate(parts)


def steps(rng: np.random.Generator, low: float, high: float, dwell_s: tuple[float, float], duration_s: float) -> Array:
    """Return random levels held for random times."""
    found = np.empty(round(duration_s / SAMPLE_S))
    at = 0
    while at < len(found):
        end = at + round(rng.uniform(*dwell_s) / SAMPLE_S)
        found[at:end] = rng.uniform(low, high)
        at = end
    return found


def staircase(rest: float, levels: Sequence[float], rest_s: float, level_s: float) -> Array:
    """Return each level in turn, with a rest before it."""
    parts = [np.full(round(s / SAMPLE_S), x) for level in levels for x, s in ((rest, rest_s), (level, level_s))]
    return np.concatenate(parts)


def ramps(rng: np.random.Generator, low: float, high: float, leg_s: tuple[float, float], duration_s: float) -> Array:
    """Return straight lines between random levels, as an operator's hand would draw them."""
    knots_s, levels = [0.0], [rng.uniform(low, high)]
    while knots_s[-1] < duration_s:
        knots_s.append(knots_s[-1] + rng.uniform(*leg_s))
        levels.append(rng.uniform(low, high))
    return np.interp(seconds(duration_s), knots_s, levels)
