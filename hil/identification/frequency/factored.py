"""From the factors in which a transfer function is fitted to its coefficients and to the model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hil.identification.frequency.rational import Form
from hil.physics.transfer_function import TransferFunction, from_factors
from hil.record.recording import Array, Complex


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
    return scale ** -np.array(powers, dtype=np.float64)
