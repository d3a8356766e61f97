"""The steps in which a converter gives its readings, and what they hide."""

from __future__ import annotations

import numpy as np

from hil.arrays import Array
from hil.signals.interval import UNIFORM

_SAME = 1e-6  # of the range: closer values are one code, calculated twice
_MOST = 20_000  # samples that are looked at
_ON_GRID = 1e-2  # of a step: how far values lie from the grid by calculation


def rounding_step(values: Array) -> float:
    """The distance of neighbouring codes of a converter; 0 where the values lie on no grid that can be seen.

    Args:
        values: readings, shape (n,).
    """
    distinct = np.unique(values[:: max(1, len(values) // _MOST)])
    if len(distinct) < 2:
        return 0.0
    apart = np.diff(distinct)
    apart = apart[apart > _SAME * (distinct[-1] - distinct[0])]
    if not len(apart):
        return 0.0
    step = float(apart.min())
    codes = (distinct - distinct[0]) / step
    on_grid = np.abs(codes - np.rint(codes)) <= _ON_GRID
    return step if bool(on_grid.all()) else 0.0


def rounded_again(values: Array, step: float, shift: Array) -> Array:
    """Values as a converter would give them whose codes lie elsewhere by `shift` steps; 0 for no converter."""
    if step == 0.0:
        return values
    made = values / step  # and then in place: many recordings at once are more than a cache holds
    made += shift
    np.rint(made, out=made)
    made -= shift
    made *= step
    return made


def before_rounding(std: float, step: float) -> float:
    """Noise that was there before the converter added its own; 0 where two codes are all that it reaches."""
    if std < step / 2.0:
        return 0.0
    return float(np.sqrt(max(std**2 - (UNIFORM * step) ** 2, 0.0)))


def _faded(noise_std: float, step: float) -> tuple[Array, Array]:
    """(orders, what noise leaves of each) of the Fourier series in which rounding repeats from code to code."""
    k = np.arange(1.0, 20.0)
    return k, np.exp(-2.0 * (np.pi * k * before_rounding(noise_std, step) / step) ** 2)


def sine_rounding_std(noise_std: float, step: float, amplitude: float) -> float:
    """Standard uncertainty that rounding leaves in the amplitude of a sine or of one of its harmonics.

    The rounding of a sine is a sum of Bessel functions of its amplitude in steps, whose squares fall as one over it.
    """
    if step == 0.0:
        return 0.0
    k, faded = _faded(noise_std, step)
    steps = max(amplitude / step, 0.5)
    return float(step * np.sqrt(np.sum(4.0 * (faded / (np.pi * k)) ** 2 / (np.pi**2 * k * steps))))


def mean_rounding_std(noise_std: float, step: float) -> float:
    """Standard uncertainty that rounding leaves in a mean of readings of one level: noise spreads them over codes.

    The mean of rounded values is periodic in the level; its Fourier series, with the level anywhere between two codes.
    """
    if step == 0.0:
        return 0.0
    k, faded = _faded(noise_std, step)
    return float(step * np.sqrt(np.sum((faded / (np.pi * k)) ** 2 / 2.0)))


def rounding_of_means(values: Array, passed: Array, step: float, noise_std: float, shift: float) -> Array:
    """What a converter adds to means of readings that move on evenly by `passed` about each of `values`, shape (n,).

    The integral of the rounding of a value that lies d from its code is −d²/2. Noise of more than a step takes all of
    it; less is not counted on, because rounding is a part of what is seen of it.

    Args:
        values: means of what was there, shape (n,).
        passed: by each, shape (n,).
        step: between codes; 0 for no converter.
        noise_std: of single readings.
        shift: of the codes, in steps.
    """
    if step == 0.0 or noise_std > step:
        return np.zeros_like(values)
    at, wide = values / step + shift, np.maximum(passed / step, _ON_GRID)

    def integral(place: Array) -> Array:
        return -0.5 * np.square(place - np.rint(place))

    return step * (integral(at + wide / 2.0) - integral(at - wide / 2.0)) / wide
