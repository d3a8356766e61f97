"""The transfer function behind a model of the plant `transfer-function`, with the covariance of its coefficients."""

from __future__ import annotations

import numpy as np

from hil.errors import InputError, option
from hil.findings.results import FittedFunction
from hil.physics.model import Model
from hil.physics.transfer_function import coefficient_names, from_parameters, straight
from hil.record.plain import plain
from hil.record.recording import Array

_STEP = 1e-6  # of a parameter, for the slopes of the coefficients
PLANT = "transfer-function"


def function_of(model: Model, name: str) -> FittedFunction:
    """The coefficients of a model and how their uncertainties hang together.

    Effects and the offset have no place in a transfer function and are left out. Of the fits to several recordings the
    least is told.

    Raises:
        InputError: a model of another plant, or with a bent static curve.
    """
    if model.plant != PLANT:
        raise InputError(
            f"{name}: a model of {model.plant} has no transfer function; {option('to')} python, matlab, json or csv "
            "hand on its "
            "parameters"
        )
    values = model.values
    linear = straight(values, name)
    free = () if model.covariance is None else model.covariance.names
    late = "dead_time" in free
    slopes = np.column_stack([_slope(values, parameter, late) for parameter in free]) if free else np.zeros((0, 0))
    covariance = slopes @ np.array(model.covariance.matrix) @ slopes.T if model.covariance else np.zeros((0, 0))
    fits = model.origin.get("fit_percent") or {}
    return FittedFunction(
        name=name, fit_percent=min(fits.values(), default=None),
        numerator=tuple(plain(linear.numerator)), denominator=tuple(plain(linear.denominator)),
        dead_time_s=linear.dead_time_s, unit=model.parameters["gain"].unit,
        coefficients=coefficient_names(len(linear.numerator) - 1, len(linear.denominator) - 1, late) if free else (),
        covariance=tuple(map(tuple, plain(covariance))),
    )  # fmt: skip


def _slope(values: dict[str, float], name: str, late: bool) -> Array:
    """Of every coefficient with respect to a parameter, by central differences."""
    step = _STEP * max(abs(values[name]), _STEP)
    high, low = (_coefficients({**values, name: values[name] + sign * step}, late) for sign in (1.0, -1.0))
    return (high - low) / (2.0 * step)


def _coefficients(values: dict[str, float], late: bool) -> Array:
    linear = from_parameters(values)
    tail = [linear.dead_time_s] if late else []
    return np.concatenate((linear.numerator, linear.denominator[1:], tail))
