"""Descriptions of a steady-state flow curve: the polynomial of the HPV41 paper, and a monotone spline."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from hil.record.recording import Array

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator


def polynomial(command: Array, flow: Array, degree: int = 9) -> Callable[[Array], Array]:
    """The least-squares polynomial of a flow curve, as the HPV41 paper describes it (degree 9).

    A polynomial cannot lie flat in a dead band: it ripples there, and its slope changes sign. For simulation
    use `spline`.
    """
    fitted = np.polynomial.Polynomial.fit(command, flow, degree)

    def curve(values: Array) -> Array:
        return np.asarray(fitted(values), dtype=np.float64)

    return curve


def monotone(command: Array, flow: Array) -> Callable[[Array], Array]:
    """The spline of a curve that rises or falls."""
    sign = 1.0 if flow[-1] >= flow[0] else -1.0
    rising = spline(command, sign * flow)
    return lambda values: sign * np.asarray(rising(values), dtype=np.float64)


def polynomial_text(command: Array, flow: Array, degree: int = 9) -> str:
    """The polynomial as a sum of powers of u, with every digit: high powers cancel."""
    coefficients = np.polynomial.Polynomial.fit(command, flow, degree).convert().coef
    return " ".join(f"{value:+.17g}·u^{power}" for power, value in enumerate(coefficients.tolist()))


def spline(command: Array, flow: Array) -> PchipInterpolator:
    """The monotone cubic through a flow curve (PCHIP): flat where the data are flat, never overshooting."""
    from scipy.interpolate import PchipInterpolator

    with np.errstate(over="ignore"):  # one over a slope of almost nothing: its harmonic mean is 0 all the same
        return PchipInterpolator(command, np.maximum.accumulate(flow))
