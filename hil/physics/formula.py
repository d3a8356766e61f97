"""A transfer function on one line, and its poles and zeros."""

from __future__ import annotations

import numpy as np

from hil.arrays import ROUNDING
from hil.physics.transfer_function import TransferFunction
from hil.record.recording import Array

_POWERS = ("", "s", *(f"s{power}" for power in "²³⁴⁵⁶⁷⁸⁹"))
_MINUS = "−"
_LEAST_TURN = 1e-6  # rad: less than the digits of a coefficient can show


def formula(model: TransferFunction) -> str:
    """`(−150.8 s + 6361) / (s³ + 31.7 s² + 1225 s + 6345) · e^(−0.0185 s)`.

    A dead time that is nothing beside the fastest corner, as a fit leaves it where there is none, is not written.
    """
    text = f"({_polynomial(model.numerator)}) / ({_polynomial(model.denominator)})"
    return f"{text} · e^({_MINUS}{model.dead_time_s:.4g} s)" if _is_felt(model) else text


def root_text(root: complex, form: str = ".4g") -> str:
    """A pole or a zero as text; a real one without what arithmetic has left of an imaginary part."""
    return format(root.real if abs(root.imag) <= ROUNDING * abs(root) else root, form)


def _is_felt(model: TransferFunction) -> bool:
    """Whether the dead time turns the phase at the fastest corner; without corners, whether there is one at all."""
    corners = [*np.abs(np.roots(model.numerator)), *np.abs(np.roots(model.denominator))]
    return model.dead_time_s * max(corners, default=1.0) > _LEAST_TURN


def _polynomial(coefficients: Array) -> str:
    terms: list[str] = []
    for power, value in zip(range(len(coefficients) - 1, -1, -1), coefficients.tolist(), strict=True):
        size = "" if abs(value) == 1.0 and power else f"{abs(value):.4g}"
        sign = ("" if value >= 0.0 else _MINUS) if not terms else ("+ " if value >= 0.0 else f"{_MINUS} ")
        terms.append(sign + " ".join(filter(None, (size, _POWERS[power]))))
    return " ".join(terms)
