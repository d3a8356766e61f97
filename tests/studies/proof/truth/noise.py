"""Sensor noise: white, partly coloured, or with a hum well below it; the whole always has the stated deviation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .law import Array
from .simulate import SAMPLE_S


@dataclass(frozen=True, slots=True)
class Colour:
    """Share of the variance that is first-order coloured, its memory a sample, and a hum in deviations."""

    share: float = 0.0
    memory: float = 0.0
    hum: float = 0.0
    hum_hz: float = 0.0


WHITE = Colour()


def draw_colour(rng: np.random.Generator, names: tuple[str, ...]) -> Colour:
    """Draw one of the colours `white`, `ar90`, `ar99`, `hum`."""
    name = str(rng.choice(names))
    if name == "ar90":
        return Colour(rng.uniform(0.2, 0.8), 0.9)
    if name == "ar99":
        return Colour(rng.uniform(0.05, 0.4), 0.99)
    if name == "hum":
        return Colour(hum=rng.uniform(0.1, 0.3), hum_hz=rng.uniform(10.0, 110.0))
    return WHITE


def noise(colour: Colour, deviation: float, samples: int, rng: np.random.Generator) -> Array:
    """Return noise of the given standard deviation."""
    white = rng.standard_normal(samples)
    coloured = _coloured(colour.memory, samples, rng)
    phase = rng.uniform(0.0, 2.0 * np.pi)
    hum = colour.hum * np.sqrt(2.0) * np.sin(2.0 * np.pi * colour.hum_hz * SAMPLE_S * np.arange(samples) + phase)
    mixed = np.sqrt(1.0 - colour.share) * white + np.sqrt(colour.share) * coloured + hum
    return np.asarray(deviation * mixed / np.sqrt(1.0 + colour.hum**2))


def _coloured(memory: float, samples: int, rng: np.random.Generator) -> Array:
    from scipy.signal import lfilter

    driven = rng.standard_normal(samples) * np.sqrt(1.0 - memory**2)
    first = rng.standard_normal() * memory
    return np.asarray(lfilter([1.0], [1.0, -memory], driven, zi=[first])[0])


def converted(values: Array, span: float) -> Array:
    """Return what a 16-bit converter of ±span makes of values."""
    step = span / 32768.0
    return np.asarray(np.clip(np.round(values / step) * step, -span, span))
