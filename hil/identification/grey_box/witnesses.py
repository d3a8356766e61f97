"""Where noise shows with no input in it: at rest, and in what differs between two answers to one command."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from hil.identification.grey_box.criteria import CRITERIA, EFFORT
from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.time_constant import time_constant_s
from hil.physics.model import Model
from hil.record.recording import Array


def witnesses(
    model: Model, experiments: Sequence[Experiment], outputs: Sequence[Array], simulated: Sequence[Array], floor: float
) -> list[Array]:
    """Stretches of noise, each about a mean of its own.

    Args:
        model: the fitted one.
        experiments: the recordings.
        outputs: what was measured in each, shape (n,).
        simulated: what the model makes of each, shape (n,).
        floor: of white noise: a model that moves by less stands.
    """
    inputs = [e.on_grid_input() for e in experiments]
    repeats = [d for u, y in zip(inputs, outputs, strict=True) if (d := repeat_difference(u, y)) is not None]
    pairs = [
        np.asarray(y - other)[len(y) // 20 :] / np.sqrt(2.0)
        for (u, y), (v, other) in combinations(zip(inputs, outputs, strict=True), 2)
        if np.array_equal(u, v) and np.ptp(u) > 0.0
    ]
    answers = zip(experiments, outputs, simulated, strict=True)
    return [*repeats, *pairs, *(y[rest] for e, y, made in answers for rest in _rests(model, e, made, floor))]


def _rests(model: Model, e: Experiment, simulated: Array, floor: float) -> list[slice]:
    """Where neither the command nor the model moves, and has not for long; none of a plant that does not settle."""
    settling = round(CRITERIA.rest_times * time_constant_s(model, e) / e.interval_s)
    if not settling:
        return []
    least = max(CRITERIA.fewest_rest, settling)
    command = e.on_grid_input()
    ends = np.concatenate(([0], np.flatnonzero(np.diff(command)) + 1, [len(command)]))
    long = np.flatnonzero(np.diff(ends) >= least)
    found = []
    for first, stop in zip(ends[long].tolist(), ends[long + 1].tolist(), strict=True):
        moving = np.flatnonzero(np.abs(simulated[first:stop] - simulated[stop - 1]) > floor)
        begin = first + (CRITERIA.rest_times * (int(moving[-1]) + 1) if moving.size else 0)
        if stop - begin >= least and e.valid[begin:stop].all():
            found.append(slice(begin, stop))
    return found


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
    for k in np.linspace(0, n // 5 - 1, EFFORT.probes).astype(np.int64):  # one sample may tell that a lag is none
        lags = lags[(inputs[lags + k] - inputs[k]) ** 2 < CRITERIA.repeats * power * (n - lags)]
    if not lags.size:
        return None
    mismatch = _mean_square_difference(inputs)[lags]
    good = lags[(mismatch < CRITERIA.repeats * power) & (_variance_from(inputs)[lags] > CRITERIA.still_moving * power)]
    if not good.size:
        return None
    lag = int(good[0])
    return (output[lag:] - output[:-lag])[n // 20 :] / np.sqrt(2.0)


def _variance_from(values: Array) -> Array:
    """Variance of v(t ≥ lag) for every lag."""
    counts = np.arange(len(values), 0, -1)
    centred = values - values.mean()
    means = np.cumsum(centred[::-1])[::-1] / counts
    return np.cumsum(centred[::-1] ** 2)[::-1] / counts - means**2


def _mean_square_difference(values: Array) -> Array:
    """Mean of (v(t + lag) − v(t))² for every lag."""
    centred = values - values.mean()
    n = len(centred)
    spectrum = np.abs(np.fft.rfft(centred, 2 * n)) ** 2
    product = np.fft.irfft(spectrum, 2 * n)[:n]
    squares = np.concatenate(([0.0], np.cumsum(centred**2)))
    counts = np.arange(n, 0, -1)
    both = squares[counts] + squares[n] - squares[n - counts]
    return np.maximum(both - 2.0 * product, 0.0) / counts
