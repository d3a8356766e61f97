"""Extremes: the largest of many noisy values is a value only where noise alone could not have made it."""

from __future__ import annotations

import math

from hil.record.measurement import COVERAGE_FACTOR, Measured, Measurement
from hil.signals.interval import CERTAIN


def extreme(
    what: Measurement, value: float, std: float, *, calibration: float = 0.0, made_by_noise: float = 0.0
) -> Measured:
    """A largest value that cannot be below 0: as measured, or `<` the bound that these data give it.

    Args:
        what: the quantity.
        value: as read from the estimate, not below 0.
        std: its standard uncertainty, offset of the extreme included.
        calibration: as in `Measurement.of`.
        made_by_noise: what the same evaluation reads, root mean square, where there is nothing. So much may be in
            any value that is not many times larger.
    """
    if not (math.isfinite(value) and math.isfinite(std)):
        return what.of(None)
    if value >= CERTAIN * math.hypot(std, made_by_noise):
        return what.of(value, std, calibration=calibration)
    bound = value + COVERAGE_FACTOR * math.hypot(std, calibration)
    return what.of(rounded_up(bound), 0.0, relation="<")


def at_most_one(what: Measurement, value: float, std: float) -> Measured:
    """A ratio of the smaller to the larger, or `>` the bound that these data give it: noise tells equals apart."""
    short = extreme(what, 1.0 - value, std)
    if short.relation == "=":
        return what.of(value, std)
    return what.of(None if short.value is None else 1.0 - short.value, 0.0, relation=">")


def rounded_up(bound: float) -> float:
    """An upper bound to two digits, never lower."""
    if not bound > 0.0:
        return bound
    digits = 1 - math.floor(math.log10(bound))
    return round(math.ceil(bound * 10.0**digits) / 10.0**digits, max(digits, 0))
