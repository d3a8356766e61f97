"""From the factors in which a transfer function is fitted to its coefficients and to the model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hil.identification.rational import Form
from hil.physics.transfer_function import TransferFunction, from_factors
from hil.record.recording import Array

Complex = NDArray[np.complex128]


def model_of(form: Form, parameters: Array) -> TransferFunction:
    """The transfer function that parameters of a form stand for."""
    gain, lags, leads, dead_time = _parts(form, parameters.astype(np.complex128))
    real = [[f.real for f in factor] for factor in lags], [[f.real for f in factor] for factor in leads]
    return from_factors(gain.real, *real, dead_time.real)


def coefficients(form: Form, parameters: NDArray[np.number]) -> Complex:
    """Monic coefficients as an analytic function of the parameters (see `TransferFunctionFit.coefficients`)."""
    gain, lags, leads, dead_time = _parts(form, np.asarray(parameters, dtype=np.complex128))
    above, below = gain * _product(leads), _product(lags)
    late = [dead_time] if form.dead_time else []
    return np.concatenate((above / below[0], below[1:] / below[0], late))


def readings(form: Form, parameters: NDArray[np.number]) -> list[tuple[str, str, complex]]:
    """What everybody reads: name, unit and value of gain, dead time, time constants, oscillations and zeros.

    The values are analytic functions of the parameters.
    """
    gain, lags, leads, dead_time = _parts(form, np.asarray(parameters, dtype=np.complex128))
    late = [("dead time", "s", dead_time)] if form.dead_time or form.dead_time_s else []
    poles = [row for lag in lags for row in _lag(lag)]
    return [("gain", "", gain), *late, *sorted(poles, key=lambda row: row[0] != "time constant"), *_zeros(leads)]


def _lag(factor: Complex) -> list[tuple[str, str, complex]]:
    if len(factor) == 1:
        return [("time constant", "s", complex(factor[0]))]
    root, square = np.sqrt(factor[0] ** 2 / 4.0 - factor[1]), np.sqrt(factor[1])
    if abs(root.real) > abs(root.imag):
        return [("time constant", "s", complex(factor[0] / 2.0 + sign * root)) for sign in (1.0, -1.0)]
    return [("frequency", "rad/s", complex(1.0 / square)), ("damping", "", complex(factor[0] / 2.0 / square))]


def _zeros(leads: list[Complex]) -> list[tuple[str, str, complex]]:
    """Those that are one by one; what a pair says is in the list of zeros."""
    return [("zero", "rad/s", complex(-1.0 / lead[0])) for lead in leads if len(lead) == 1 and lead[0]]


def _parts(form: Form, p: Complex) -> tuple[complex, list[Complex], list[Complex], complex]:
    at = int(form.dc_gain is None)
    gain = complex(p[0]) if form.dc_gain is None else complex(form.dc_gain)
    factors: list[Complex] = []
    for order in (*form.lags, *form.leads):
        factors.append(p[at : at + order])
        at += order
    dead_time = complex(p[at]) if form.dead_time else complex(form.dead_time_s)
    return gain, factors[: len(form.lags)], factors[len(form.lags) :], dead_time


def _product(factors: list[Complex]) -> Complex:
    made = np.ones(1, dtype=np.complex128)
    for factor in factors:
        made = np.convolve(made, np.concatenate((factor[::-1], [1.0])))
    return made


def units(form: Form, scale: float) -> Array:
    """Factors that turn scaled parameters into seconds."""
    orders = [k + 1 for order in (*form.lags, *form.leads) for k in range(order)]
    powers = [0] * int(form.dc_gain is None) + orders + [1] * int(form.dead_time)
    made: Array = scale ** -np.array(powers, dtype=np.float64)
    return made
