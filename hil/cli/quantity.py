"""Numbers with a unit, as people type them: `2s`, `200 ms`, `50 %`, `-3,5 bar`."""

from __future__ import annotations

import math

from hil.errors import SettingError


def quantity(text: str, unit: str, name: str) -> float:
    """As `hil.session.quantity.number_in`; a single number may have a comma, and is finite.

    Raises:
        SettingError: no number, one beyond every number, or of another kind of unit.
    """
    from hil.session.quantity import number_in

    value = number_in(text.replace(",", "."), unit, name)
    if not math.isfinite(value):
        raise SettingError(f"{name} {text}: beyond every number")
    return value
