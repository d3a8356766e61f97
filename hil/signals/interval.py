"""How wide an interval is: one number and one law for every room that states one."""

from __future__ import annotations

import math

from hil.errors import InputError

COVERED = 1.96
"""Standard uncertainties on either side of a value within which 95 % of a normal distribution lie."""

ONE_SIDED = 1.645
"""Standard uncertainties from a value to an upper limit of 95 %."""

UNIFORM = 1.0 / math.sqrt(12.0)
"""Standard deviation of what lies anywhere within a width, over that width."""

CERTAIN = 4.0
"""Standard uncertainties below which the largest of many values stays by noise alone."""

_ARITHMETIC = 1e-12  # of a value: half an interval below that is a computer's rounding
_DECIMALS, _DIGITS = 9, 12  # more are written with an exponent; no computation keeps more digits


def rounded(value: float, std: float | None) -> str:
    """A value to the second digit of its interval; one that has none to six."""
    return _to_place(value, COVERED * std) if std and math.isfinite(std) else f"{value:.6g}"


def width(std: float | None) -> str:
    """Half an interval as text, to two digits."""
    if std is None:
        return "held"
    if not math.isfinite(std):
        return "not identifiable"
    return f"± {_to_place(COVERED * std, COVERED * std)}" if std else "± 0"


def is_arithmetic(half: float, value: float) -> bool:
    """Whether half an interval of a value is nothing but a computer's rounding, and is not shown."""
    return half < _ARITHMETIC * abs(value)


def _to_place(value: float, half: float) -> str:
    """A value to the second digit of half an interval; no digits that arithmetic does not have."""
    places = 1 - math.floor(math.log10(float(f"{half:.1e}")))
    if places <= _DECIMALS:
        return f"{round(value, places):.{max(places, 0)}f}"
    digits = places + math.floor(math.log10(abs(value) or half))
    return f"{value:.{max(digits, 0)}e}" if digits <= _DIGITS else f"{value:.9g}"


def exact_limits(count: int, of: int) -> tuple[float, float]:
    """95 % limits of a share after Clopper and Pearson: they hold it at least so often, however few were counted.

    Raises:
        InputError: no count out of a larger one.
    """
    from scipy.special import betaincinv

    if not 0 <= count <= of or of == 0:
        raise InputError(f"share {count} of {of}: a count out of a larger one is needed")
    low = 0.0 if count == 0 else float(betaincinv(count, of - count + 1, 0.025))
    high = 1.0 if count == of else float(betaincinv(count + 1, of - count, 0.975))
    return low, high
