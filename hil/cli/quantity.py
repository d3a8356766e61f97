"""Numbers with a unit, as people type them: `2s`, `200 ms`, `50 %`, `-3,5 bar`."""

from __future__ import annotations

import math
import re

from hil.errors import SettingError, UnitError

_QUANTITY = re.compile(r"\s*([+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")


def quantity(text: str, unit: str, name: str) -> float:
    """What is meant, in `unit`; a number alone is in that unit already.

    Args:
        text: as it was typed.
        unit: in which it is wanted.
        name: of what it is, for the error.

    Raises:
        SettingError: no number, or of another kind of unit.
    """
    from hil.units import scale_and_offset

    found = _QUANTITY.fullmatch(text)
    if found is None:
        raise SettingError(f"{name} {text}: a number was expected, with or without its unit, such as 2 {unit}")
    number = float(found[1].replace(",", "."))
    try:
        slope, offset = scale_and_offset(found[2] or unit, unit)
    except UnitError as error:
        raise SettingError(f"{name} {text}: {error}") from None
    value = slope * number + offset
    if not math.isfinite(value):
        raise SettingError(f"{name} {text}: beyond every number")
    return value
