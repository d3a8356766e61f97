"""Numbers with a unit as people type them: `20s`, `200 ms`, `10 %`; a bare number has the declared unit."""

from __future__ import annotations

import math
import re

from hil.errors import SettingError, UnitError
from hil.units import scale_and_offset

_QUANTITY = re.compile(r"^\s*(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(?P<unit>[^\d\s].*)?$")
_COMMA = re.compile(r"\d,\d")


def number_in(text: str, unit: str, what: str) -> float:
    """The number that a text says, in a unit.

    Args:
        text: as it was typed.
        unit: in which it is declared; empty where only the bench knows.
        what: of which a message speaks, `setting cycle_s`.

    Raises:
        SettingError: no number, or a unit that is none of that kind.
    """
    found = _QUANTITY.match(text)
    if _COMMA.search(text):
        raise SettingError(f"{what}: '{text.strip()}': numbers are typed with a point, as in 0.2")
    if found is None:
        raise SettingError(f"{what}: '{text.strip()}' is not a number{_in_unit(unit)}")
    value, given = float(found["number"]), (found["unit"] or "").strip()
    if not given or given == unit:
        return value
    if not unit:
        raise SettingError(f"{what}: '{text.strip()}': its unit is that of the bench; give the number alone")
    try:
        scale, offset = scale_and_offset(given, unit)
    except UnitError:
        raise SettingError(f"{what}: '{text.strip()}': a number{_in_unit(unit)} was expected") from None
    # to the digits that were typed: 0.2 s are 200 ms, and not 200.00000000000003
    return float(f"{scale * value + offset:.12g}") if math.isfinite(value) else value


def _in_unit(unit: str) -> str:
    return f" in {unit}" if unit and unit != "1" else ""
