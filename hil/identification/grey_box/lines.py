"""Tones in what a model leaves: one frequency in all recordings, with a phase of its own in each, as hum has."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hil.arrays import LEAST
from hil.identification.grey_box.criteria import CRITERIA, EFFORT
from hil.identification.preparation.experiment import Experiment
from hil.record.recording import Array
from hil.signals.tone import BY_CHANCE, Tone, best_tone, power_of

_LEAST_RATIO = -math.log2(BY_CHANCE)  # a line of noise alone over the median of its spectrum
_SAME_BIN = 1.0  # within which a harmonic is recognised


def common_line(
    experiments: Sequence[Experiment],
    residuals: Sequence[Array],
    least_ratio: float = _LEAST_RATIO,
    fewest_cycles: int = CRITERIA.fewest_cycles,
) -> float | None:
    """The frequency in Hz whose line stands out most over all recordings, away from the command's own lines.

    None when it is less than `least_ratio` times the median around it, on average over the recordings. Lines
    with less than `fewest_cycles` in the shortest recording are not looked for.
    """
    shortest_s = min(e.duration_s for e in experiments)
    fastest_hz = min(0.5 / e.drive.interval_s for e in experiments)
    grid = np.arange(float(fewest_cycles), fastest_hz * shortest_s) / shortest_s
    if not grid.size:
        return None
    total = np.zeros(len(grid))
    for e, left in zip(experiments, residuals, strict=True):
        own = power_of(e.on_grid_input())
        commanded = (own > CRITERIA.commanded * own.max()) & (prominence(own) > CRITERIA.commanded_ratio)
        ratio = np.where(commanded, 1.0, prominence(power_of(left)))
        frequency = np.fft.rfftfreq(len(left), e.drive.interval_s)
        # the highest within a bin of the coarsest grid
        edges = np.searchsorted(frequency, grid - 0.5 / shortest_s)
        total += np.maximum.reduceat(ratio, np.minimum(edges, len(ratio) - 1))
    k = int(np.argmax(total))
    return float(grid[k]) if total[k] > least_ratio * len(experiments) else None


def is_commanded(experiments: Sequence[Experiment], frequency_hz: float) -> bool:
    """Whether a frequency is one that every recording was driven at, or a harmonic of it."""
    return all(_drives(e, frequency_hz) for e in experiments)


def _drives(e: Experiment, frequency_hz: float) -> bool:
    command = e.on_grid_input()
    power = power_of(command)
    strong = np.flatnonzero(
        (power > CRITERIA.strong_line * power.max()) & (prominence(power) > CRITERIA.commanded_ratio)
    )
    peaks = [int(k) for k in strong if power[k] == power[max(k - EFFORT.line_bins, 0) : k + EFFORT.line_bins + 1].max()]
    if not 0 < len(peaks) <= CRITERIA.few_lines:
        return False
    at = frequency_hz * len(command) * e.drive.interval_s
    lines = [between_bins(power, k) for k in peaks]
    return any(
        abs(at - harmonic * line) <= _SAME_BIN for line in lines for harmonic in range(1, CRITERIA.harmonics + 1)
    )


def prominence(power: Array) -> Array:
    """How far each bin of a spectrum stands above its neighbourhood, and above what is just below it in frequency.

    A spectrum that falls steeply, as what a plant that integrates has added up, has no line at its steep end.
    """
    from scipy.ndimage import median_filter  # a quarter of a second, which whoever only imports this does without

    around = median_filter(power, EFFORT.neighbourhood, mode="reflect")
    below = median_filter(power, EFFORT.lowest_bins, mode="nearest", origin=EFFORT.lowest_bins // 2)
    shifted = np.concatenate([np.full(EFFORT.line_bins, np.inf), below[: -EFFORT.line_bins]])
    return power / np.maximum(np.maximum(around, shifted), LEAST)


def between_bins(power: Array, k: int) -> float:
    """The place of a peak between bins, by a parabola through the logarithms."""
    if k + 1 >= len(power):
        return float(k)
    a, b, c = np.log(power[k - 1 : k + 2] + LEAST)
    bend = a - 2.0 * b + c
    return k + (0.5 * (a - c) / bend if bend < 0.0 else 0.0)


def line_at(time_s: Array, values: Array, frequency_hz: float) -> tuple[Array, float]:
    """The tone in values nearest to a frequency, and its amplitude.

    Within a bin either way, at the frequency where it takes most: a known frequency is never known to a cycle.
    """
    width_hz = 1.0 / float(time_s[-1] - time_s[0])
    tone = Tone(frequency_hz, 0.0, 0.0)
    for scale in EFFORT.line_grids:
        tone = best_tone([(time_s, values)], tone.frequency_hz + scale * width_hz * np.linspace(-1.0, 1.0, 11))
    return tone.at(time_s), tone.amplitude
