"""Multisines: many frequencies at once, some lines left silent so that distortion shows itself there.

An odd multisine excites odd multiples of its base frequency only. What answers on even lines is even
distortion (asymmetry); what answers on odd lines that were left silent is odd distortion (friction, dead
band, saturation); what changes from period to period is noise. Pintelon, Schoukens: System Identification,
a Frequency Domain Approach, 2nd ed., ch. 4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hil.arrays import LEAST, ROUNDING, Array, Complex, Integers
from hil.errors import SettingError


@dataclass(frozen=True, slots=True)
class Multisine:
    """One period of a multisine and what its lines are for.

    Attributes:
        base_hz: spacing of the lines; one period lasts 1/base_hz.
        rate_hz: of the samples.
        excited, odd_detection, even_detection: line numbers, multiples of `base_hz`.
        period: samples of one period, zero mean, shape (rate/base,).
    """

    base_hz: float
    rate_hz: float
    excited: Integers
    odd_detection: Integers
    even_detection: Integers
    period: Array

    @property
    def crest_factor(self) -> float:
        """Peak over rms; 1.41 for a single sine."""
        return float(np.max(np.abs(self.period)) / np.sqrt(np.mean(self.period**2)))

    def signal(self, periods: int, bias: float = 0.0) -> Array:
        """Repeated periods about a bias."""
        return bias + np.tile(self.period, periods)

    def as_part(self) -> dict[str, object]:
        """What an evaluation needs to know, as JSON values."""
        return {
            "kind": "multisine",
            "base_hz": self.base_hz,
            "excited": self.excited.tolist(),
            "odd_detection": self.odd_detection.tolist(),
            "even_detection": self.even_detection.tolist(),
        }


def odd_multisine(
    low_hz: float,
    high_hz: float,
    base_hz: float,
    rate_hz: float,
    peak: float,
    *,
    group: int = 4,
    seed: int = 0,
    crest_iterations: int = 200,
) -> Multisine:
    """An odd random-phase multisine with equal line amplitudes and a random silent line in each group.

    Phases start random and are improved by clipping in time and keeping the phases (van der Ouderaa,
    Schoukens, Renneboog: IEEE Trans. Instrum. Meas. 37(1), 1988). Zero iterations leave them random, as an
    average over several realisations wants them.

    Args:
        low_hz: lower end of the band of excited lines.
        high_hz: upper end of the band.
        base_hz: line spacing; one period must be a whole number of samples.
        rate_hz: sample rate.
        peak: largest value, in the unit of the command.
        group: odd lines per group, of which one at random stays silent; 0 excites them all.
        seed: of silent lines and phases.
        crest_iterations: how long phases are improved.

    Raises:
        SettingError: the band holds no line, the period is no whole number of samples, or the rate is below
            20 times the top frequency.
    """
    samples = round(rate_hz / base_hz)
    if abs(samples * base_hz - rate_hz) > ROUNDING * rate_hz:
        raise SettingError(f"base frequency {base_hz:g} Hz: one period must be whole samples at {rate_hz:g} Hz")
    if rate_hz < 20.0 * high_hz:
        raise SettingError(f"sample rate {rate_hz:g} Hz is below 20 × the top frequency {high_hz:g} Hz")
    band = np.arange(math.ceil(low_hz / base_hz - ROUNDING), math.floor(high_hz / base_hz + ROUNDING) + 1)
    odd = band[band % 2 == 1]
    rng = np.random.default_rng(seed)
    silent = _one_of_each(odd, group, rng)
    excited = np.setdiff1d(odd, silent)
    if not excited.size:
        raise SettingError(f"no odd multiple of {base_hz:g} Hz to excite within {low_hz:g}…{high_hz:g} Hz")
    even = np.arange(2, band[-1] + 2, 2)
    period = _low_crest(excited, samples, rng, crest_iterations)
    return Multisine(base_hz, rate_hz, excited, silent, even, period * (peak / np.max(np.abs(period))))


def _one_of_each(odd: Integers, group: int, rng: np.random.Generator) -> Integers:
    """A random line of each full group; the first and last line stay excited, so that the band keeps its ends."""
    if group < 2:
        return np.array([], dtype=np.int64)
    inner = odd[1:-1]
    starts = range(0, len(inner) - group + 1, group)
    return np.array([inner[start + rng.integers(group)] for start in starts], dtype=np.int64)


def _low_crest(excited: Integers, samples: int, rng: np.random.Generator, iterations: int) -> Array:
    """Random phases, improved by clipping at a level that rises slowly, the best of all steps kept."""
    phasors = np.exp(2j * math.pi * rng.random(len(excited)))
    best = wave = _wave(excited, phasors, samples)
    for i in range(iterations):
        level = (0.75 + 0.2 * i / iterations) * np.max(np.abs(wave))
        clipped = np.fft.rfft(np.clip(wave, -level, level))[excited]
        wave = _wave(excited, clipped / np.maximum(np.abs(clipped), LEAST), samples)
        if np.max(np.abs(wave)) < np.max(np.abs(best)):
            best = wave
    return best


def _wave(excited: Integers, phasors: Complex, samples: int) -> Array:
    spectrum = np.zeros(samples // 2 + 1, dtype=complex)
    spectrum[excited] = phasors * samples / 2.0
    return np.fft.irfft(spectrum, samples)
