"""The noise of a channel: its floor before any model is believed, its colour from what a model leaves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.arrays import LEAST, ROUNDING
from hil.identification.uncertainty.fit import rms
from hil.physics.model import Noise
from hil.record.recording import Array
from hil.signals.autoregression import autocovariance, coloured, whitened, yule_walker
from hil.signals.interval import COVERED, UNIFORM

MEDIAN_SHARE = 0.6745  # of the standard deviation of normal noise, that half of it does not exceed
_LONGEST_MEMORY = 8
# Noise is called coloured only when a longer memory makes this much of its variance predictable.
_TELLING_SHARE = 0.01
# Samples after which noise is forgotten, and times that what means take of it is put back.
_TAIL, _MEANS = 4096, 4
# Standard uncertainty of the floor of white noise, a median of fourth differences, times √n.
_MEDIAN_SPREAD = 1.63
# A recording's floor within so many times that of its model's identification does not contradict it.
_CONTRADICTED = 1.25
# Noise so many times the resolution makes a channel that hardly ever repeats itself.
NOISE_OVER_RESOLUTION = 2.0


@dataclass(frozen=True, slots=True)
class Measured:
    """The noise of recordings, and what a model leaves of them.

    Attributes:
        noise: its level, colour and uncertainty.
        left: the same of all that the model leaves.
        is_witnessed: whether noise was seen where no input is in it, and is less; else what is left beyond the noise
            may be coloured noise.
    """

    noise: Noise
    left: Noise
    is_witnessed: bool

    @property
    def discrepancy(self) -> float:
        """Rms of what is left beyond the noise, in the output's unit; 0 where that is within its uncertainty."""
        return math.sqrt(max(self.left.std**2 - self.noise.std**2, 0.0))


def white_floor(values: Array) -> float:
    """Standard deviation of white noise on a smooth signal, from its fourth differences.

    Robust to steps (a median); blind to coloured noise, which needs repeated periods or a model. Where a channel stands
    at one value for more than half of the time, which a noisy one does not by itself, it is that of the rest. 0 for no
    values.
    """
    if not len(values):
        return 0.0
    floor = _of_fourth_differences(values)
    if floor > 0.0:
        return floor
    moving = _of_fourth_differences(_without_rest(values))
    return moving if moving > NOISE_OVER_RESOLUTION * resolution(values) else 0.0


def _without_rest(values: Array) -> Array:
    """The samples that do not have the most common value."""
    levels, counts = np.unique(values, return_counts=True)
    return values[values != levels[np.argmax(counts)]]


def _of_fourth_differences(values: Array) -> float:
    if len(values) < 16:
        return 0.0
    return _grouped_median(np.abs(np.diff(values, 4)), resolution(values)) / MEDIAN_SHARE / math.sqrt(70.0)


def _grouped_median(sizes: Array, step: float) -> float:
    """The median of what was rounded to whole steps, interpolated within its step; 0 where that is nothing."""
    median = float(np.median(sizes))
    if median == 0.0:
        return 0.0
    below, above = (int(np.count_nonzero(sizes < median + half)) for half in (-0.5 * step, 0.5 * step))
    return median + step * ((0.5 * len(sizes) - below) / max(above - below, 1) - 0.5)


def resolution(values: Array) -> float:
    """The smallest step between two samples, beyond rounding; 0 for a channel that stands still."""
    steps = np.abs(np.diff(values))
    steps = steps[steps > ROUNDING * max(float(np.ptp(values)), LEAST)]
    return float(steps.min()) if steps.size else 0.0


def channel_floor(values: Array) -> float:
    """The least noise a channel has: by its fourth differences, and by the resolution of its converter.

    0 for a channel that stands still: it tells nothing of it.
    """
    return max(white_floor(values), rounding_of(values))


def rounding_of(values: Array) -> float:
    """What rounding adds: the standard deviation of a converter's, or of the number that a file has."""
    return max(UNIFORM * resolution(values), 1e-6 * float(np.ptp(values)))


def channel_floors(recorded: Sequence[Mapping[str, Array]]) -> tuple[dict[str, float], ...]:
    """The floors of channels, by recording and name.

    A channel that stands still hides it: then it is the largest of the other recordings; one that never moves has none.
    """
    floors = [{name: channel_floor(values) for name, values in own.items()} for own in recorded]
    largest = {name: max(other.get(name, 0.0) for other in floors) for own in floors for name in own}
    return tuple({name: floor or largest[name] for name, floor in own.items() if largest[name]} for own in floors)


def noise_of(segments: Sequence[Array], interval_s: float) -> Noise:
    """Level, colour and uncertainty of stretches of noise about means of their own, by Yule–Walker.

    The order is the lowest from which a longer memory no longer makes the noise more predictable. Of noise that nobody
    has seen the level is 0.
    """
    raw = autocovariance(segments, _LONGEST_MEMORY)
    if raw[0] <= 0.0:
        return Noise(0.0)
    colour, correlation = _predictor(raw), raw
    for _ in range(_MEANS):  # a mean takes some of the noise with it, the more the longer its memory
        correlation = raw + raw[0] * _share_of_means(colour, [len(r) for r in segments])
        colour = _predictor(correlation)
    std, one = float(np.sqrt(correlation[0])), _correlation_of(colour)
    independent = sum(map(len, segments)) / float(2.0 * one @ one - 1.0)
    return Noise(std, colour, interval_s, std_uncertainty=std / math.sqrt(2.0 * independent))


def _predictor(correlation: Array) -> tuple[float, ...]:
    """a_1 … a_p of autocorrelations at lags from 0 on."""
    known = correlation.copy()
    known[0] *= 1.0 + ROUNDING  # residuals may be so smooth that they predict themselves
    best: tuple[float, ...] = ()
    left = known[0]
    for order in range(1, _LONGEST_MEMORY + 1):
        found, unexplained = yule_walker(known, order)
        if unexplained < (1.0 - _TELLING_SHARE) * left:
            best, left = tuple(found[1:].tolist()), unexplained
    return best


def _share_of_means(colour: tuple[float, ...], lengths: Sequence[int]) -> float:
    """Variance of the means of stretches over that of the noise."""
    one = _correlation_of(colour)
    shares = [(2.0 * float(np.maximum(1.0 - np.arange(_TAIL) / n, 0.0) @ one) - 1.0) / n for n in lengths]
    return min(float(np.average(shares, weights=lengths)), 1.0)


def _correlation_of(colour: tuple[float, ...]) -> Array:
    """Autocorrelation at lags from 0 on, shape (_TAIL,)."""
    response = _impulse_response(colour)
    power = np.abs(np.fft.rfft(response, 2 * _TAIL)) ** 2
    found = np.fft.irfft(power)[:_TAIL]
    return found / found[0]


def measured_noise(
    outputs: Sequence[Array], witnesses: Sequence[Array], residuals: Sequence[Array], step_s: float
) -> Measured:
    """The noise of recordings, given what the best model left of them.

    White noise shows in the highest differences of any recording. Coloured noise is believed only where no input is in
    it. What a model leaves is noise where it is no more than that, within its uncertainty. Else what is beyond it
    counts as discrepancy: a misfit must not pass for noise.

    Args:
        outputs: where they say something, shape (n,) each.
        witnesses: stretches of noise with no input in it (see `grey_box.witnesses`), shape (n,) each.
        residuals: of the model, shape (n,) each.
        step_s: interval of the samples.
    """
    # white noise as all outputs show it, and less where a model takes what is no noise out of their differences
    floors = [
        max(min(channel_floor(y), white_floor(r)), rounding_of(y)) for y, r in zip(outputs, residuals, strict=True)
    ]
    floor = rms(np.array(floors))
    noise = Noise(floor, std_uncertainty=_MEDIAN_SPREAD * floor / math.sqrt(sum(map(len, outputs))))
    seen, left = noise_of(_alike(witnesses, step_s), step_s), noise_of(residuals, step_s)
    if _exceeds(seen, noise):
        noise = seen
    if not (_exceeds(left, noise) or _exceeds(noise, left)):
        noise = replace(left, std_uncertainty=noise.std_uncertainty)
    return Measured(noise, left, seen.std > 0.0 and _exceeds(left, seen))


def _alike(witnesses: Sequence[Array], step_s: float) -> list[Array]:
    """Stretches that show no more than the median one: where a unit moves on while its model stands, they do."""
    levels = [noise_of([segment], step_s) for segment in witnesses]
    median = sorted(levels, key=lambda level: level.std)[(len(levels) - 1) // 2 :][:1]
    return [s for s, level in zip(witnesses, levels, strict=True) if not _exceeds(level, *median)]


def _exceeds(more: Noise, less: Noise) -> bool:
    """Whether a level is above another one, beyond the uncertainty of both."""
    return more.std - less.std > COVERED * math.hypot(more.std_uncertainty, less.std_uncertainty)


def noise_in(known: Noise | None, floor: float) -> Noise:
    """The noise of a recording: that of its model's identification, unless the recording's own floor contradicts it."""
    if known is None or known.std <= 0.0:
        return Noise(floor)
    expected = _white_floor_of(known)
    if 1.0 / _CONTRADICTED < floor / expected < _CONTRADICTED:
        return known
    return replace(known, std=known.std * floor / expected)


def _white_floor_of(noise: Noise) -> float:
    """What `white_floor` would say of this noise: coloured noise hides most of itself from differences."""
    fourth = np.poly([1.0] * 8)  # products of fourth differences, of lags −4…4: (1 − z)⁸
    correlation = _correlation_of(noise.colour)[:5]
    power = float(fourth[4:] @ correlation * 2.0 - fourth[4] * correlation[0])
    return noise.std * math.sqrt(max(power, 0.0) / 70.0)


def whiten(residuals: Array, noise: Noise, interval_s: float) -> Array:
    """Residuals as white noise of unit variance, if they are this noise.

    The colour is used only at the sampling interval that it was found at.
    """
    same_rate = noise.interval_s is not None and abs(noise.interval_s / interval_s - 1.0) < 0.02
    if not noise.colour or not same_rate:
        return residuals / noise.std
    innovations = whitened(residuals.T, np.array((1.0, *noise.colour))).T
    response = _impulse_response(noise.colour)  # its power is the noise's over that of its white source
    return innovations / (noise.std * math.sqrt(1.0 / float(response @ response)))


def _impulse_response(colour: tuple[float, ...]) -> Array:
    """What one white sample makes, shape (_TAIL,)."""
    return coloured(np.r_[1.0, np.zeros(_TAIL - 1)], np.array((1.0, *colour)))
