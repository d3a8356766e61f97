"""Entries of a header in words: `fluid_temperature_c: 40` becomes `Fluid temperature`, `40 °C`."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from hil.language.words import _
from hil.report.name import capital, within
from hil.report.number import number, unit_text
from hil.units import split_unit


def facts_of(values: Mapping[str, Any], units: Mapping[str, str] = MappingProxyType({})) -> list[tuple[str, str]]:
    """Every entry that says something, as (label, text); in units of their own where the names have none."""
    return [
        fact_of(name, value, units.get(name, "")) for name, value in values.items() if value not in (None, "", [], {})
    ]


def fact_of(name: str, value: Any, own_unit: str = "") -> tuple[str, str]:
    """(`Fluid temperature`, `40 °C`) from `fluid_temperature_c`."""
    label, unit = split_unit(name)
    unit = unit_text(unit)
    if not unit and own_unit and value not in (None, "") and not isinstance(value, bool):
        return capital(_(label)), f"{text_of(value)} {own_unit}"
    if unit and isinstance(value, int | float) and not isinstance(value, bool):
        return capital(_(label)), f"{number(value, 6)} {unit}"
    if unit and isinstance(value, Mapping):
        return capital(_(label)), "; ".join(f"{key} {text_of(v)} {unit}" for key, v in value.items())
    return capital(_(name.replace("_", " "))), text_of(value)


def text_of(value: Any) -> str:
    """A JSON value in words."""
    if isinstance(value, bool):
        return _("yes") if value else _("no")
    if isinstance(value, int | float):
        return str(value) if isinstance(value, int) else number(value, 6)
    if isinstance(value, Mapping):
        facts = (fact_of(str(name), v) for name, v in value.items() if v not in (None, ""))
        return "; ".join(f"{within(label)} {text}" for label, text in facts)
    if isinstance(value, list | tuple):
        return ", ".join(text_of(v) for v in value)
    return "—" if value is None else str(value)
