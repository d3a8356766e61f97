"""A transfer function on one line."""

from __future__ import annotations

from hil.physics.transfer_function import TransferFunction
from hil.record.recording import Array

_POWERS = ("", "s", *(f"s{power}" for power in "²³⁴⁵⁶⁷⁸⁹"))
_MINUS = "−"


def formula(model: TransferFunction) -> str:
    """`(−150.8 s + 6361) / (s³ + 31.7 s² + 1225 s + 6345) · e^(−0.0185 s)`."""
    text = f"({_polynomial(model.numerator)}) / ({_polynomial(model.denominator)})"
    return f"{text} · e^({_MINUS}{model.dead_time_s:.4g} s)" if model.dead_time_s else text


def _polynomial(coefficients: Array) -> str:
    terms: list[str] = []
    for power, value in zip(range(len(coefficients) - 1, -1, -1), coefficients.tolist(), strict=True):
        size = "" if abs(value) == 1.0 and power else f"{abs(value):.4g}"
        sign = ("" if value >= 0.0 else _MINUS) if not terms else ("+ " if value >= 0.0 else f"{_MINUS} ")
        terms.append(sign + " ".join(filter(None, (size, _POWERS[power]))))
    return " ".join(terms)
