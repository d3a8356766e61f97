"""The noise of a channel: its floor before any model is believed, its colour from what a model leaves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from hil.physics.model import Noise
from hil.record.recording import Array

_LONGEST_MEMORY = 8
# Noise is called coloured only when a longer memory makes this much of its variance predictable.
_TELLING_SHARE = 0.01
_AGREEING = 1.15
# Residuals of which past inputs explain less than this share have nothing to do with them.
_UNRELATED = 0.02
# What is so many times above the white floor is a slow misfit: in one recording nothing tells drifting noise from it.
_MOST_COLOURED = 12.0
_DELAYS_S = (0.0, 0.01, 0.02, 0.04, 0.08, 0.15, 0.3, 0.6, 1.0)
_WHITE_SHARE = 1e-9
_STILL_MOVING = 0.1
# Noise so many times the resolution makes a channel that hardly ever repeats itself.
NOISE_OVER_RESOLUTION = 2.0


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
    kept: Array = values[values != levels[np.argmax(counts)]]
    return kept


def _of_fourth_differences(values: Array) -> float:
    if len(values) < 16:
        return 0.0
    fourth = np.diff(values, 4)
    return float(np.median(np.abs(fourth)) / 0.6745 / np.sqrt(70.0))


def resolution(values: Array) -> float:
    """The smallest step between two samples, beyond rounding; 0 for a channel that stands still."""
    steps = np.abs(np.diff(values))
    steps = steps[steps > 1e-9 * max(float(np.ptp(values)), 1e-300)]
    return float(steps.min()) if steps.size else 0.0


def channel_floor(values: Array) -> float:
    """The least noise a channel has: by its fourth differences, and by the resolution of its converter.

    0 for a channel that stands still: it tells nothing of it.
    """
    rounding = resolution(values) / float(np.sqrt(12.0))
    return max(white_floor(values), rounding, 1e-6 * float(np.ptp(values)))


def channel_floors(recorded: Sequence[Mapping[str, Array]]) -> tuple[dict[str, float], ...]:
    """The floors of channels, by recording and name.

    A channel that stands still hides it: then it is the largest of the other recordings; one that never moves has none.
    """
    floors = [{name: channel_floor(values) for name, values in own.items()} for own in recorded]
    largest = {name: max(other.get(name, 0.0) for other in floors) for own in floors for name in own}
    return tuple({name: floor or largest[name] for name, floor in own.items() if largest[name]} for own in floors)


def noise_of(residuals: Sequence[Array], interval_s: float) -> Noise:
    """Level and colour of residuals, one array per recording, by Yule–Walker.

    The order is the lowest from which a longer memory no longer makes the noise more predictable.
    """
    correlation = _autocorrelation(residuals, _LONGEST_MEMORY)
    std = float(np.sqrt(correlation[0]))
    correlation[0] *= 1.0 + _WHITE_SHARE  # residuals may be so smooth that they predict themselves
    best: tuple[float, ...] = ()
    left = correlation[0]
    for order in range(1, _LONGEST_MEMORY + 1):
        weights = solve_toeplitz(correlation[:order], correlation[1 : order + 1])
        unexplained = correlation[0] - float(weights @ correlation[1 : order + 1])
        if unexplained < (1.0 - _TELLING_SHARE) * left:
            best, left = tuple(-weights), unexplained
    return Noise(std, best, interval_s)


def repeat_difference(inputs: Array, output: Array) -> Array | None:
    """What differs between two periods of a periodic recording, scaled to one: noise and nothing else.

    A misfit repeats with the input, noise does not. None when the input does not repeat itself; rest after rest is
    no repetition.
    """
    n = len(output)
    power = float(np.var(inputs))
    shortest, longest = max(n // 20, 1), n - n // 5
    if power == 0.0 or longest <= shortest:
        return None
    lags = np.arange(shortest, longest)
    mismatch = _mean_square_difference(inputs)[lags]
    good = lags[(mismatch < 1e-8 * power) & (_variance_from(inputs)[lags] > _STILL_MOVING * power)]
    if not good.size:
        return None
    lag = int(good[0])
    difference: Array = (output[lag:] - output[:-lag])[n // 20 :] / np.sqrt(2.0)
    return difference


def _variance_from(values: Array) -> Array:
    """Variance of v(t ≥ lag) for every lag."""
    counts = np.arange(len(values), 0, -1)
    centred = values - values.mean()
    means = np.cumsum(centred[::-1])[::-1] / counts
    result: Array = np.cumsum(centred[::-1] ** 2)[::-1] / counts - means**2
    return result


def _mean_square_difference(values: Array) -> Array:
    """Mean of (v(t + lag) − v(t))² for every lag."""
    centred = values - values.mean()
    n = len(centred)
    spectrum = np.abs(np.fft.rfft(centred, 2 * n)) ** 2
    product = np.fft.irfft(spectrum, 2 * n)[:n]
    squares = np.concatenate(([0.0], np.cumsum(centred**2)))
    counts = np.arange(n, 0, -1)
    both = squares[counts] + squares[n] - squares[n - counts]
    result: Array = np.maximum(both - 2.0 * product, 0.0) / counts
    return result


def measured_noise(
    inputs: Sequence[Array], outputs: Sequence[Array], residuals: Sequence[Array], step_s: float
) -> Noise:
    """The noise of recordings, given what the best model left of them.

    Where an input repeats itself, the periods tell noise from misfit; elsewhere the fourth differences do. The
    residuals' own level and colour are taken only when they agree with that, or when they have nothing to do with
    the input: a misfit must not pass for noise. A channel that stands still most of the time has at least the noise
    of its resolution.
    """
    differences = [d for u, y in zip(inputs, outputs, strict=True) if (d := repeat_difference(u, y)) is not None]
    left = noise_of(residuals, step_s)
    if differences:
        repeats = noise_of(differences, step_s)
        return left if left.std < _AGREEING * repeats.std else repeats
    floor = float(np.sqrt(np.mean([channel_floor(y) ** 2 for y in outputs])))
    if left.std < _AGREEING * floor:
        return left
    believable = left.colour and left.std < _MOST_COLOURED * floor
    if believable and _share_of_input(inputs, residuals, left, step_s) < _UNRELATED:
        return left
    return Noise(floor)


def _share_of_input(inputs: Sequence[Array], residuals: Sequence[Array], noise: Noise, step_s: float) -> float:
    """The share of the whitened residuals' variance that past inputs explain, beyond what chance would give."""
    explained, total, count, columns = 0.0, 0.0, 0, 0
    for u, r in zip(inputs, residuals, strict=True):
        white = whiten(r, noise, step_s)
        basis = _of_past_inputs(u, step_s)
        fitted = basis @ np.linalg.lstsq(basis, white, rcond=1e-8)[0]
        explained += float(fitted @ fitted)
        total += float(white @ white)
        count, columns = count + len(r), columns + basis.shape[1]
    return (explained / total - columns / count) / (1.0 - columns / count)


def _of_past_inputs(u: Array, step_s: float) -> Array:
    """Powers of the input and the sign of its motion, at delays up to a second, shape (n, columns)."""
    scale = max(float(np.abs(u).max()), 1e-12)
    level, motion = u / scale, np.sign(np.diff(u, prepend=u[0]))
    columns = [np.ones(len(u))]
    for delay_s in _DELAYS_S:
        k = min(round(delay_s / step_s), len(u) - 1)
        past = np.concatenate((np.full(k, level[0]), level[: len(u) - k]))
        moving = np.concatenate((np.zeros(k), motion[: len(u) - k]))
        columns += [past, past**2, past**3, np.abs(past), moving]
    return np.column_stack(columns)


def whiten(residuals: Array, noise: Noise, interval_s: float) -> Array:
    """Residuals as white noise of unit variance, if they are this noise.

    The colour is used only at the sampling interval that it was found at.
    """
    same_rate = noise.interval_s is not None and abs(noise.interval_s / interval_s - 1.0) < 0.02
    if not noise.colour or not same_rate:
        return residuals / noise.std
    filtered: Array = lfilter((1.0, *noise.colour), (1.0,), residuals, axis=0)
    white: Array = filtered / (noise.std * np.sqrt(_innovation_share(noise.colour)))
    return white


def _innovation_share(colour: tuple[float, ...]) -> float:
    """Variance of the white source over that of the coloured noise."""
    response = lfilter((1.0,), (1.0, *colour), np.r_[1.0, np.zeros(4095)])
    return 1.0 / float(response @ response)


def _autocorrelation(residuals: Sequence[Array], lags: int) -> Array:
    total, count = np.zeros(lags + 1), 0
    for r in residuals:
        centred = r - r.mean()
        total += [float(centred[: len(r) - k] @ centred[k:]) for k in range(lags + 1)]
        count += len(r)
    return total / count
