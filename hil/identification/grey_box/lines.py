"""Tones in what a model leaves: one frequency in all recordings, with a phase of its own in each, as hum has."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hil.identification.preparation.experiment import Experiment, power_of
from hil.record.recording import Array

# A line of noise alone stands so far above the median of its spectrum about once in a million bins.
_LEAST_RATIO = 20.0
# Slower than this, in cycles of a recording, it is no hum but a drift, of which there are other kinds.
_FEWEST_CYCLES = 20
_FINER = (1.0, 0.2, 0.04)
# A line stands out from its neighbourhood of so many bins: coloured noise has more at some frequencies than at others.
_NEIGHBOURHOOD = 101
# A line of the command is this share of its strongest, and stands so far above its own neighbourhood: steps have some
# of every frequency, and yet no line.
_COMMANDED, _A_LINE = 1e-4, 10.0
# A command of so few lines at most drives a unit at them and at so many of their harmonics, told to so many bins.
_FEW_LINES, _STRONG_LINE, _HARMONICS, _SAME_BIN = 4, 0.01, 5, 1.0
# Below it so many bins are compared, where its own width of so many ends.
_BESIDE, _LINE_BINS = 7, 3


def common_line(
    experiments: Sequence[Experiment],
    residuals: Sequence[Array],
    least_ratio: float = _LEAST_RATIO,
    fewest_cycles: int = _FEWEST_CYCLES,
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
        power = np.abs(np.fft.rfft(left * np.hanning(len(left)))) ** 2 / len(left)
        own = power_of(e.on_grid_input())
        commanded = (own > _COMMANDED * own.max()) & (prominence(own) > _A_LINE)
        ratio = np.where(commanded, 1.0, prominence(power))
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
    strong = np.flatnonzero((power > _STRONG_LINE * power.max()) & (prominence(power) > _A_LINE))
    peaks = [int(k) for k in strong if power[k] == power[max(k - _LINE_BINS, 0) : k + _LINE_BINS + 1].max()]
    if not 0 < len(peaks) <= _FEW_LINES:
        return False
    at = frequency_hz * len(command) * e.drive.interval_s
    lines = [between_bins(power, k) for k in peaks]
    return any(abs(at - harmonic * line) <= _SAME_BIN for line in lines for harmonic in range(1, _HARMONICS + 1))


def prominence(power: Array) -> Array:
    """How far each bin of a spectrum stands above its neighbourhood, and above what is just below it in frequency.

    A spectrum that falls steeply, as what a plant that integrates has added up, has no line at its steep end.
    """
    from scipy.ndimage import median_filter  # a quarter of a second, which whoever only imports this does without

    around = median_filter(power, _NEIGHBOURHOOD, mode="reflect")
    below = median_filter(power, _BESIDE, mode="nearest", origin=_BESIDE // 2)
    shifted = np.concatenate([np.full(_LINE_BINS, np.inf), below[:-_LINE_BINS]])
    return power / np.maximum(np.maximum(around, shifted), 1e-300)


def between_bins(power: Array, k: int) -> float:
    """The place of a peak between bins, by a parabola through the logarithms."""
    if k + 1 >= len(power):
        return float(k)
    a, b, c = np.log(power[k - 1 : k + 2] + 1e-300)
    bend = a - 2.0 * b + c
    return k + (0.5 * (a - c) / bend if bend < 0.0 else 0.0)


def line_at(time_s: Array, values: Array, frequency_hz: float) -> tuple[Array, float]:
    """The tone in values nearest to a frequency, and its amplitude.

    Within a bin either way, at the frequency where it takes most: a known frequency is never known to a cycle.
    """
    width_hz = 1.0 / float(time_s[-1] - time_s[0])
    best_hz = frequency_hz
    for scale in _FINER:
        tried = best_hz + scale * width_hz * np.linspace(-1.0, 1.0, 11)
        best_hz = float(max(tried, key=lambda hz: _sine(time_s, values, hz)[1]))
    return _sine(time_s, values, best_hz)


def _sine(time_s: Array, values: Array, frequency_hz: float) -> tuple[Array, float]:
    phase = 2.0 * np.pi * frequency_hz * time_s
    basis = np.column_stack([np.sin(phase), np.cos(phase)])
    weights = np.linalg.solve(basis.T @ basis, basis.T @ values)
    return basis @ weights, float(np.hypot(*weights))
