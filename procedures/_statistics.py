"""Statistics of figures: extremes that noise alone could make, means of repeats, and what repeats differ by."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from hil.record.measurement import COVERAGE_FACTOR, Measured, Measurement
from hil.signals.interval import CERTAIN


def mean_of(repeats: Collection[tuple[float, float]], *, shared: bool = True) -> tuple[float, float]:
    """Mean of (value, standard uncertainty) of repeats: as sure as they state, or as they scatter, whichever is less.

    `shared`: what a repeat states is in all of them alike, as of one evaluation; else it averages out.
    """
    values, stds = (np.array(column) for column in zip(*repeats, strict=True))
    stated = float(np.sqrt(np.mean(stds**2))) / (1.0 if shared else math.sqrt(len(values)))
    scatter = float(values.std(ddof=1)) / math.sqrt(len(values)) if len(values) > 1 else 0.0
    return float(values.mean()), max(scatter, stated)


def disagreement(visits: Collection[tuple[float, float]]) -> float:
    """What (value, standard uncertainty) of one level differ by, where that is more than these explain; else 0."""
    if len(visits) < 2:
        return 0.0
    values, stds = zip(*visits, strict=True)
    apart = float(np.ptp(values))
    return apart if apart > CERTAIN * math.sqrt(2.0) * max(stds) else 0.0


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
