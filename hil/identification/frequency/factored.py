"""From the factors in which a transfer function is fitted to its coefficients and to the model."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.identification.frequency.rational import Form
from hil.physics.transfer_function import TransferFunction, from_factors, product
from hil.record.recording import Array, Complex


def model_of(form: Form, parameters: Array) -> TransferFunction:
    """The transfer function that parameters of a form stand for."""
    return from_factors(*_parts(form, parameters.tolist()))


def coefficients(form: Form, parameters: NDArray[np.number]) -> Complex:
    """Monic coefficients as an analytic function of the parameters (see `TransferFunctionFit.coefficients`)."""
    gain, lags, leads, dead_time = _parts(form, parameters.astype(np.complex128).tolist())
    above, below = gain * product(leads), product(lags)
    late = [dead_time] if form.dead_time else []
    return np.concatenate((above / below[0], below[1:] / below[0], late))


def _parts(form: Form, p: list[Any]) -> tuple[Any, list[list[Any]], list[list[Any]], Any]:
    at, factors = 1, []
    for order in (*form.lags, *form.leads):
        factors.append(p[at : at + order])
        at += order
    dead_time = p[at] if form.dead_time else form.dead_time_s
    return p[0], factors[: len(form.lags)], factors[len(form.lags) :], dead_time


def units(form: Form, scale: float) -> Array:
    """Factors that turn scaled parameters into seconds."""
    orders = [k + 1 for order in (*form.lags, *form.leads) for k in range(order)]
    return scale ** -np.array([0, *orders, *[1] * int(form.dead_time)], dtype=np.float64)
