"""Recursive digital filters from rest, without the second that importing `scipy.signal` takes every program."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.kernel import kernel

Polynomial = Sequence[float] | Sequence[complex] | NDArray[Any]


@kernel("f8[:,::1](f8[::1], f8[::1], f8[:,::1])", "c16[:,::1](c16[::1], c16[::1], c16[:,::1])")
def _filtered(above: Any, below: Any, rows: Any) -> Any:
    out = np.empty_like(rows)
    order = len(below) - 1
    for k in range(rows.shape[0]):
        state = np.zeros_like(above)
        for i in range(rows.shape[1]):
            given = rows[k, i]
            made = state[0] + above[0] * given
            for j in range(order):
                state[j] = state[j + 1] + above[j + 1] * given - below[j + 1] * made
            out[k, i] = made
    return out


def filtered(numerator: Polynomial, denominator: Polynomial, signal: NDArray[Any]) -> NDArray[Any]:
    """Response of B(1/z)/A(1/z) to a signal from rest, in direct form II transposed (Oppenheim and Schafer, 6.3).

    Args:
        numerator: coefficients of B, real or complex.
        denominator: coefficients of A, the first of them 1.
        signal: shape (…, n); each row is filtered for itself.
    """
    kind = np.result_type(np.float64, *map(np.asarray, (numerator, denominator, signal)))
    above, below = np.zeros((2, max(len(numerator), len(denominator)) + 1), dtype=kind)
    above[: len(numerator)], below[: len(denominator)] = numerator, denominator
    rows = np.ascontiguousarray(signal, dtype=kind).reshape(-1, np.shape(signal)[-1])
    made = _filtered(above, below, rows)
    return made.reshape(np.shape(signal))
