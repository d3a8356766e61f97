"""The straight line of a calibration, with what is known of it (GUM, JCGM 100; weighted least squares)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil.errors import SettingError
from hil.signals.interval import UNIFORM

_LEVEL = 0.95
_ROUNDED = 1e-12  # of the largest reading: what is left is arithmetic
_REFUSED = 0.01  # residuals that the stated uncertainties would give more rarely than that are larger than stated
_ROUNDS = 3  # the noise of the raw reading weighs by the slope, which is not known before


@dataclass(frozen=True, slots=True)
class Point:
    """One point: what the terminal read or was given, its standard uncertainty, and what the reference read."""

    raw: float
    raw_std: float
    reference: float


@dataclass(frozen=True, slots=True)
class Line:
    """reference = slope · raw + offset, and what is known of it.

    Attributes:
        slope, offset: of the line.
        slope_interval, offset_interval: half of the interval that holds the true one in 95 % of calibrations.
        residuals: reference less line, by point.
        non_linearity: the largest of them, as a size.
        exceeds: whether residuals are larger than the uncertainties that were stated can make: the channel is not
            straight, or the reference worse than was said. The intervals are those of the residuals then. Never true
            where no uncertainty of the reference was stated.
        uncertainty: expanded (k = 2) of a value that is read through the line, anywhere between the points.
    """

    slope: float
    offset: float
    slope_interval: float
    offset_interval: float
    residuals: tuple[float, ...]
    non_linearity: float
    exceeds: bool
    uncertainty: float


def fit_line(points: Sequence[Point], reference_std: float | None = None) -> Line:
    """The line through the points, weighted by their uncertainties.

    Args:
        points: at least three, or two where the uncertainty of the reference is stated; at two places or more.
        reference_std: standard uncertainty of each reading of the reference, independent from point to point; None when
            nobody states it, and the residuals must tell.

    Raises:
        SettingError: too few points, or all at one place.
    """
    from scipy import special

    raw, reference, noise = (
        np.array([getattr(p, name) for p in points], dtype=np.float64) for name in ("raw", "reference", "raw_std")
    )
    stated = reference_std is not None and reference_std > 0.0
    free = len(points) - 2
    if free < (0 if stated else 1):
        raise SettingError(f"{len(points)} points: two with the uncertainty of the reference, three without it")
    if np.ptp(raw) <= max(4.0 * float(noise.max()), 1e-12 * float(np.abs(raw).max())):
        raise SettingError(
            f"all points are at {raw.mean():.5g}: the quantity did not move, or the channel does not follow it"
        )
    rows = np.column_stack((raw, np.ones_like(raw)))
    slope, std = 0.0, np.ones_like(raw)
    for _ in range(_ROUNDS if stated else 1):
        if stated:
            std = np.hypot(reference_std or 0.0, slope * noise)
        (slope, offset), *_ = np.linalg.lstsq(rows / std[:, None], reference / std, rcond=None)
    residuals = reference - rows @ (slope, offset)
    residuals[np.abs(residuals) <= _ROUNDED * np.abs(reference).max()] = 0.0
    covariance = np.linalg.inv((rows / std[:, None]).T @ (rows / std[:, None]))
    square = float(np.sum((residuals / std) ** 2))
    exceeds = bool(stated and free and special.chdtrc(free, square) < _REFUSED)
    factor = float(special.ndtri(0.5 + 0.5 * _LEVEL))
    if exceeds or not stated:
        covariance = covariance * square / free
        factor = float(special.stdtrit(free, 0.5 + 0.5 * _LEVEL))
    worst = max(float(row @ covariance @ row) for row in rows)
    scatter = math.sqrt(square / free) if not stated else 0.0
    bent = float(np.abs(residuals).max())
    parts = (0.5 * factor * math.sqrt(worst), reference_std or scatter, 2.0 * UNIFORM * bent if exceeds else 0.0)
    return Line(
        float(slope), float(offset), factor * math.sqrt(covariance[0, 0]), factor * math.sqrt(covariance[1, 1]),
        tuple(map(float, residuals)), bent, exceeds, 2.0 * math.hypot(*parts),
    )  # fmt: skip
