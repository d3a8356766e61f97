"""What everybody reads of a transfer function: gain, dead time, time constants, oscillations, zeros; each with ±."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from hil.record.recording import Array, Complex

_REAL = 1e-9  # imaginary part over the size, up to which a root is a real one


class Reading(NamedTuple):
    """A quantity with its standard uncertainty, which is None where no covariance is known."""

    name: str
    value: float
    std: float | None
    unit: str


def readings(
    numerator: Array, denominator: Array, dead_time_s: float, covariance: Array, gain_unit: str = ""
) -> list[Reading]:
    """Gain at rest, dead time, time constants from the slowest on, oscillations, real zeros; of an integrator none.

    Args:
        numerator: from the highest power of s down.
        denominator: likewise, its first coefficient 1.
        dead_time_s: likewise a reading where it is estimated or above 0.
        covariance: of the numerator, the denominator without its 1, the dead time where estimated; else empty.
        gain_unit: of the gain.
    """
    if not denominator[-1]:
        return []
    m, n = len(numerator), len(denominator) - 1
    known = len(covariance) >= m + n

    def std(slope: Array) -> float | None:
        if not known or not np.isfinite(slope).all():
            return math.inf if known else None
        return math.sqrt(max(float(slope @ covariance[: m + n, : m + n] @ slope), 0.0))

    gain = float(numerator[-1] / denominator[-1])
    at_rest = np.zeros(m + n)
    at_rest[[m - 1, -1]] = 1.0 / denominator[-1], -gain / denominator[-1]
    made = [Reading("gain", gain, std(at_rest), gain_unit)]
    if len(covariance) > m + n or dead_time_s:
        free = math.sqrt(max(float(covariance[-1, -1]), 0.0)) if len(covariance) > m + n else 0.0
        made.append(Reading("dead time", dead_time_s, free if known else None, "s"))
    poles = [(root, np.append(np.zeros(m), slope[1:])) for root, slope in _roots(denominator)]
    for root, slope in poles:
        if not root.imag:
            made.append(Reading("time constant", -1.0 / root.real, std(slope.real / root.real**2), "s"))
    for root, slope in poles:
        if root.imag:
            size, along = abs(root), np.asarray((root.conjugate() * slope).real / abs(root), np.float64)
            made.append(Reading("frequency", size, std(along), "rad/s"))
            damping = -slope.real / size + root.real / size**2 * along
            made.append(Reading("damping", -root.real / size, std(damping), ""))
    for root, slope in _roots(numerator):
        if not root.imag:
            made.append(Reading("zero", root.real, std(np.append(slope.real, np.zeros(n))), "rad/s"))
    return made


def _roots(polynomial: Array) -> Iterator[tuple[complex, Complex]]:
    """Real roots and those above the real axis, from the slowest on, with their slopes by the coefficients."""
    powers = np.arange(len(polynomial) - 1, -1, -1)
    for root in sorted(np.roots(polynomial).tolist(), key=abs):
        real = abs(root.imag) <= _REAL * abs(root)
        at = complex(root.real) if real else root
        if real or root.imag > 0.0:
            with np.errstate(divide="ignore", invalid="ignore"):  # a double root has no slope
                yield at, -(at**powers) / np.polyval(np.polyder(polynomial), at)
