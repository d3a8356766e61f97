"""Confidence bands of a fitted transfer function: Bode, bandwidths, poles, zeros, step response."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hil.identification.frequency.rational import evaluate
from hil.identification.frequency.transfer_function import TransferFunctionFit
from hil.record.recording import Array, Complex
from hil.signals.decibel import PER_NEPER, decibels


@dataclass(frozen=True, slots=True)
class BodeBand:
    """A Bode curve with standard uncertainties; every array of shape (n,)."""

    frequency_hz: Array
    magnitude_db: Array
    magnitude_std_db: Array
    phase_deg: Array
    phase_std_deg: Array


def bode_band(fit: TransferFunctionFit, frequency_hz: Array) -> BodeBand:
    """The fitted Bode curve at frequencies in rising order."""
    value, slope = _slope(fit, frequency_hz)
    std_log, std_rad = _std(slope.real, fit.covariance), _std(slope.imag, fit.covariance)
    phase = np.degrees(np.unwrap(np.angle(value)))
    return BodeBand(frequency_hz, decibels(value), PER_NEPER * std_log, phase, np.degrees(std_rad))


def _slope(fit: TransferFunctionFit, frequency_hz: Array) -> tuple[Complex, Complex]:
    """Model values and the derivative of their logarithm: real part magnitude, imaginary part phase."""
    s = np.asarray(2j * math.pi * frequency_hz, dtype=np.complex128)
    value, jacobian = evaluate(fit.form, fit.parameters, s)
    return value, jacobian / value[:, None]


def _std(rows: Array, covariance: Array) -> Array:
    return np.sqrt(np.maximum(np.einsum("np,pq,nq->n", rows, covariance, rows), 0.0))
