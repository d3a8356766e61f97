"""Confidence bands of a fitted transfer function: Bode, bandwidths, poles, zeros, step response."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from hil.identification.frequency.bandwidth import Crossing, model_crossing
from hil.identification.frequency.rational import evaluate
from hil.identification.frequency.transfer_function import TransferFunctionFit
from hil.record.recording import Array, Complex

_DB = 20.0 / math.log(10.0)
_SMALL = 1e-4  # of a standard deviation: step of the central difference of a step response


@dataclass(frozen=True, slots=True)
class BodeBand:
    """A Bode curve with standard uncertainties; every array of shape (n,)."""

    frequency_hz: Array
    magnitude_db: Array
    magnitude_std_db: Array
    phase_deg: Array
    phase_std_deg: Array


@dataclass(frozen=True, slots=True)
class Root:
    """A pole or zero in rad/s with the covariance of its (Re, Im), shape (2, 2)."""

    value: complex
    covariance: Array


def bode_band(fit: TransferFunctionFit, frequency_hz: Array) -> BodeBand:
    """The fitted Bode curve at frequencies in rising order."""
    value, slope = _slope(fit, frequency_hz)
    std_log, std_rad = _std(slope.real, fit.covariance), _std(slope.imag, fit.covariance)
    phase = np.degrees(np.unwrap(np.angle(value)))
    return BodeBand(frequency_hz, 20.0 * np.log10(np.abs(value)), _DB * std_log, phase, np.degrees(std_rad))


def crossing(fit: TransferFunctionFit, level: float, unit: str, top_hz: float) -> Crossing:
    """Where the fitted curve falls to a level: dB below its gain at rest, or degrees; with uncertainty."""
    found = model_crossing(fit.model, level, unit, top_hz)
    if found.frequency_hz is None:
        return found
    near = found.frequency_hz * np.array([1.0, 1.0 - 1e-5, 1.0 + 1e-5])
    value, slope = _slope(fit, near)
    if unit == "dB":
        relative = slope[0].real.copy()
        if fit.form.dc_gain is None:
            relative[0] = 0.0  # a larger gain raises the gain at rest as well
        rate = float(np.diff(_DB * np.log(np.abs(value[1:])))[0])
        std = _DB * float(_std(relative[None], fit.covariance)[0])
    else:
        rate = math.degrees(float(np.angle(value[2] / value[1])))
        std = math.degrees(float(_std(slope[:1].imag, fit.covariance)[0]))
    return replace(found, std_hz=std / abs(rate / float(near[2] - near[1])))


def poles(fit: TransferFunctionFit) -> tuple[Root, ...]:
    """Poles with uncertainty; a double pole has none that is finite."""
    zeros = fit.form.zeros
    at = slice(zeros + 1, zeros + 1 + fit.form.poles)
    return _roots(np.concatenate(([1.0], fit.coefficients[at])), _embedded(fit.coefficient_covariance[at, at]))


def zeros(fit: TransferFunctionFit) -> tuple[Root, ...]:
    """Zeros with uncertainty."""
    at = slice(0, fit.form.zeros + 1)
    return _roots(fit.coefficients[at], fit.coefficient_covariance[at, at])


def _slope(fit: TransferFunctionFit, frequency_hz: Array) -> tuple[Complex, Complex]:
    """Model values and the derivative of their logarithm: real part magnitude, imaginary part phase."""
    s = np.asarray(2j * math.pi * frequency_hz, dtype=np.complex128)
    value, jacobian = evaluate(fit.form, fit.parameters, s)
    return value, jacobian / value[:, None]


def _std(rows: Array, covariance: Array) -> Array:
    made: Array = np.sqrt(np.maximum(np.einsum("np,pq,nq->n", rows, covariance, rows), 0.0))
    return made


def _embedded(covariance: Array) -> Array:
    """Covariance of coefficients with that of the leading one, which is exactly 1, put in front."""
    made = np.zeros((len(covariance) + 1, len(covariance) + 1))
    made[1:, 1:] = covariance
    return made


def _roots(polynomial: Array, covariance: Array) -> tuple[Root, ...]:
    """Roots with dr = −Σ r^k·dc_k / P′(r)."""
    powers = np.arange(len(polynomial) - 1, -1, -1)
    made = []
    for root in sorted(np.roots(polynomial), key=lambda r: (round(abs(r), 9), r.imag)):
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = -(root**powers) / np.polyval(np.polyder(polynomial), root)
        parts = np.stack((slope.real, slope.imag))
        made.append(Root(complex(root), parts @ covariance @ parts.T))
    return tuple(made)
