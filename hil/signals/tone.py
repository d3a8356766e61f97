"""A tone beneath a response: hum or pump ripple that goes on whatever the command does, seen where that stands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil.arrays import Array

BY_CHANCE = 1e-6  # of a line as strong in noise of the same power
_LEAST_PERIODS = 4.0
_FINE = 10  # frequencies tried within what the whole time resolves


@dataclass(frozen=True, slots=True)
class Tone:
    """A sine of `frequency_hz`: cosine and sine part in the unit of the samples."""

    frequency_hz: float
    cosine: float
    sine: float

    @property
    def amplitude(self) -> float:
        """In the unit of the samples."""
        return math.hypot(self.cosine, self.sine)

    def at(self, time_s: Array) -> Array:
        """Its samples."""
        turn = 2.0 * math.pi * self.frequency_hz * time_s
        return self.cosine * np.cos(turn) + self.sine * np.sin(turn)


def power_of(values: Array) -> Array:
    """Power at each frequency about the mean, seen through a Hann window; without a scale."""
    return np.abs(np.fft.rfft((values - values.mean()) * np.hanning(len(values)))) ** 2


def standing_tone(segments: Sequence[tuple[Array, Array]]) -> Tone | None:
    """The tone that stretches of (time_s, samples about a steady level) share; None where noise explains them.

    Each stretch has samples about its own level, evenly spaced; the first line is looked for in the longest.
    """
    time_s, values = max(segments, key=lambda one: len(one[0]))
    n = len(values)
    if n < 8 * _LEAST_PERIODS:
        return None
    power = power_of(values)
    lines = np.arange(len(power)) >= _LEAST_PERIODS
    peak = int(np.argmax(np.where(lines, power, 0.0)))
    beside = power[lines & (np.abs(np.arange(len(power)) - peak) > 2)]
    if not len(beside) or power[peak] < math.log(n / BY_CHANCE) * float(np.mean(beside)):
        return None
    resolved_hz = 1.0 / float(time_s[-1] - time_s[0])
    whole_s = max(float(t[-1]) for t, _ in segments) - min(float(t[0]) for t, _ in segments)
    tried = peak * resolved_hz + np.arange(-resolved_hz, resolved_hz, 1.0 / (_FINE * whole_s))
    return best_tone(segments, tried)


def best_tone(segments: Sequence[tuple[Array, Array]], tried_hz: Array) -> Tone:
    """The tone of one of these frequencies that explains most of stretches of (time_s, samples)."""
    return max((_fitted(segments, hz) for hz in tried_hz.tolist()), key=lambda one: one[1])[0]


def _fitted(segments: Sequence[tuple[Array, Array]], frequency_hz: float) -> tuple[Tone, float]:
    """The tone of a frequency by least squares, and the power that it explains."""
    turn = 2.0 * math.pi * frequency_hz * np.concatenate([t for t, _ in segments])
    columns, values = np.stack((np.cos(turn), np.sin(turn))), np.concatenate([v for _, v in segments])
    loads = columns @ values
    cosine, sine = np.linalg.solve(columns @ columns.T, loads)
    return Tone(frequency_hz, float(cosine), float(sine)), float(loads @ np.array([cosine, sine]))
