"""Real poles and zeros from a Bode magnitude by its asymptotes: eqs 3.1 to 3.6 of the EFC thesis (Santos, Carvalho).

A real corner at ω_i bends ln|G| over x = ln ω by −t·½·ln(1 + e^{2(x − x_i)}), t = 1 for a pole and −1 for a zero;
its asymptote is 0 below the corner and −t·(x − x_i) above. First the asymptotes are fitted, then the curve itself
from there. The magnitude alone cannot tell a zero from its mirror image in the right half plane, sees no dead
time, and real corners make no resonance: `hil.identification.frequency.order_choice` fits the complex response instead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from hil.errors import InputError
from hil.identification.frequency.frequency_response import FrequencyResponse
from hil.physics.transfer_function import TransferFunction, from_factors
from hil.record.recording import Array
from hil.signals.decibel import PER_NEPER
from hil.signals.interval import COVERED

_STARTS = 9  # corners that the search for a start chooses among
_MOST_STARTS = 4000
_BEYOND = math.log(30.0)  # how far outside the measured frequencies a corner may lie


@dataclass(frozen=True, slots=True)
class AsymptoticFit:
    """Corners found from the magnitude.

    Attributes:
        model: gain and real corners, every one in the left half plane because the magnitude cannot tell.
        asymptotic_misfit: J of eq. 3.6 over the span of ln ω: mean square of ln-magnitude to the asymptotes, halved.
        misfit: V of eq. 3.1 over the number of lines: the same to the curve.
        pole_stds, zero_stds: standard uncertainties of the corners in rad/s, slowest first, from what the curve leaves;
            infinite where an interval would be wider than the corner, as of two that lie together.
    """

    model: TransferFunction
    asymptotic_misfit: float
    misfit: float
    pole_stds: Array
    zero_stds: Array

    @property
    def poles_rad_s(self) -> Array:
        """Corners of the poles, slowest first."""
        return np.abs(self.model.poles)

    @property
    def zeros_rad_s(self) -> Array:
        """Corners of the zeros, slowest first."""
        return np.abs(self.model.zeros)

    @property
    def rms_db(self) -> float:
        """Root mean square error of the magnitude in dB."""
        return PER_NEPER * math.sqrt(2.0 * self.misfit)


def log_corner(x: Array, corner: float, kind: int) -> Array:
    """A real corner's part of ln|G| (eq. 3.3): `kind` 1 for a pole, −1 for a zero."""
    return -0.5 * kind * np.logaddexp(0.0, 2.0 * (x - corner))


def asymptote(x: Array, corner: float, kind: int) -> Array:
    """Its asymptote (eq. 3.4)."""
    return -kind * np.maximum(x - corner, 0.0)


def asymptotic_bode(response: FrequencyResponse, poles: int, zeros: int = 0) -> AsymptoticFit:
    """Fit a gain and so many real poles and zeros to the magnitude.

    Raises:
        InputError: no pole, more zeros than poles, or fewer lines than unknowns.
    """
    if poles < 1 or not 0 <= zeros <= poles or len(response) <= poles + zeros + 1:
        raise InputError(
            f"asymptotic Bode fit of {poles} poles and {zeros} zeros to {len(response)} lines: at least one pole, no "
            "more zeros than poles, and more lines than poles, zeros and gain together"
        )
    x = np.log(2.0 * math.pi * response.frequency_hz)
    magnitude = np.log(np.abs(response.response))
    kinds = np.array([1] * poles + [-1] * zeros)
    rough = _start(x, magnitude, poles, zeros)
    coarse = _refined(x, magnitude, kinds, rough, curve=False)
    fine = min((_refined(x, magnitude, kinds, start, curve=True) for start in (coarse, rough)),
               key=lambda found: _misfit(x, magnitude, kinds, found, curve=True))  # fmt: skip
    gain = float(np.mean(magnitude - _shape(x, kinds, fine, curve=True)))
    rates = np.exp(fine)
    model = from_factors(math.exp(gain), [(1.0 / r,) for r in rates[:poles]], [(1.0 / r,) for r in rates[poles:]])
    misfit = _misfit(x, magnitude, kinds, fine, curve=True)
    stds = rates * _log_stds(x, fine, 2.0 * misfit * len(x) / (len(x) - len(fine) - 1))
    ordered = [stds[:poles][np.argsort(rates[:poles])], stds[poles:][np.argsort(rates[poles:])]]
    return AsymptoticFit(model, _misfit(x, magnitude, kinds, coarse, curve=False), misfit, *ordered)


def _log_stds(x: Array, corners: Array, variance: float) -> Array:
    """Standard uncertainties of corners in ln ω, the gain being free; infinite where an interval spans the corner."""
    slopes = np.array([1.0 / (1.0 + np.exp(2.0 * (corner - x))) for corner in corners])
    slopes -= slopes.mean(axis=1, keepdims=True)
    values, vectors = np.linalg.eigh(slopes @ slopes.T)
    stds = np.sqrt(variance * vectors**2 @ (1.0 / np.maximum(values, 1e-12 * values[-1])))
    return np.where(COVERED * stds < 1.0, stds, np.inf)


def _start(x: Array, magnitude: Array, poles: int, zeros: int) -> Array:
    """The best of a grid of corners by their asymptotes; J is no longer convex where poles and zeros lie close."""
    grid = np.linspace(x[0] - 0.5, x[-1] + 0.5, _STARTS)
    below, above = (list(combinations_with_replacement(range(len(grid)), count)) for count in (poles, zeros))
    pairs = [(p, z) for p in below for z in above if not set(p) & set(z)] or [(p, z) for p in below for z in above]
    pairs = pairs[:: max(1, len(pairs) // _MOST_STARTS)]
    bends = np.array([asymptote(x, corner, 1) for corner in grid])
    shapes = np.array([bends[list(p)].sum(axis=0) - bends[list(z)].sum(axis=0) for p, z in pairs])
    left = magnitude - shapes
    best_p, best_z = pairs[int(np.argmin(np.var(left, axis=1)))]
    return grid[[*best_p, *best_z]]


def _refined(x: Array, magnitude: Array, kinds: Array, start: Array, *, curve: bool) -> Array:
    from scipy.optimize import least_squares

    def residuals(corners: Array) -> Array:
        left = magnitude - _shape(x, kinds, corners, curve=curve)
        return left - left.mean()

    bounds = (float(x[0]) - _BEYOND, float(x[-1]) + _BEYOND)
    found = least_squares(residuals, start, bounds=bounds, x_scale=1.0)
    return np.asarray(found.x, dtype=np.float64)


def _shape(x: Array, kinds: Array, corners: Array, *, curve: bool) -> Array:
    part = log_corner if curve else asymptote
    return np.sum([part(x, corner, kind) for corner, kind in zip(corners, kinds, strict=True)], axis=0)


def _misfit(x: Array, magnitude: Array, kinds: Array, corners: Array, *, curve: bool) -> float:
    return 0.5 * float(np.var(magnitude - _shape(x, kinds, corners, curve=curve)))
