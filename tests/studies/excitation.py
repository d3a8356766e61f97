"""Commands of a lab, drawn anew for each recording: steps, sines, ramps; chirps and walks are of another kind."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rng = np.random.Generator
DURATION_S = 20.0


def steps(rng: Rng, step_s: float) -> Array:
    """Levels within ±1, each held for 0.4 to 1.5 s."""
    samples = round(DURATION_S / step_s)
    parts: list[Array] = [np.zeros(round(0.5 / step_s))]
    while sum(map(len, parts)) < samples:
        parts.append(np.full(round(rng.uniform(0.4, 1.5) / step_s), rng.uniform(-1.0, 1.0)))
    return np.concatenate(parts)[:samples]


def sines(rng: Rng, step_s: float) -> Array:
    """A sum of 15 sines from 0.1 to 12 Hz of random phase, the slow ones larger."""
    time_s = np.arange(round(DURATION_S / step_s)) * step_s
    frequencies = np.geomspace(0.1, 12.0, 15)
    phases = rng.uniform(0.0, 2.0 * np.pi, 15)
    total = sum(f**-0.3 * np.sin(2.0 * np.pi * f * time_s + p) for f, p in zip(frequencies, phases, strict=True))
    return np.asarray(total / np.max(np.abs(total)))


def ramps(rng: Rng, step_s: float) -> Array:
    """To and fro at speeds that change from ramp to ramp."""
    ends = np.append(0.0, rng.uniform(0.4, 1.0, 12) * np.where(np.arange(12) % 2, -1.0, 1.0))
    at_s = np.append(0.0, np.cumsum(rng.uniform(0.6, 3.0, 12)))
    time_s = np.arange(round(DURATION_S / step_s)) * step_s
    return np.interp(time_s * at_s[-1] / DURATION_S, at_s, ends)


def chirp(rng: Rng, step_s: float) -> Array:
    """A sine whose frequency rises from 0.1 to 10 Hz."""
    time_s = np.arange(round(DURATION_S / step_s)) * step_s
    rate = np.log(100.0) / DURATION_S
    return rng.uniform(0.5, 0.9) * np.sin(2.0 * np.pi * 0.1 / rate * np.expm1(rate * time_s))


def walk(rng: Rng, step_s: float) -> Array:
    """A random walk, led back to its middle within 2 s."""
    noise = rng.normal(0.0, 1.0, round(DURATION_S / step_s))
    level, levels = 0.0, np.empty(len(noise))
    for k, one in enumerate(noise):
        level += one * np.sqrt(step_s) - level * step_s / 2.0
        levels[k] = level
    return np.asarray(levels / np.max(np.abs(levels)))


USUAL: Mapping[str, Callable[[Rng, float], Array]] = {"steps": steps, "sines": sines, "ramps": ramps}
OTHER: Mapping[str, Callable[[Rng, float], Array]] = {"chirp": chirp, "walk": walk}
