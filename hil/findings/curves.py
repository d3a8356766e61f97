"""Curves of a procedure as tables: whatever mapping of arrays it hands over, with a unit for each column.

The rules are those of docs/reference/procedures.md: units stand at the end of a key or in the `…_unit` key beside it,
arrays of one length share their first axis.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from hil.findings.results import ColumnOf, Curve
from hil.record.plain import plain
from hil.record.recording import Array
from hil.signals.decibel import decibels
from hil.units import split_unit

_UNIT_KEYS = {
    "command": "command_unit", "rising": "response_unit", "falling": "response_unit", "std": "response_unit",
    "spline": "response_unit", "polynomial": "response_unit", "measured": "response_unit", "fitted": "response_unit",
    "gain": "gain_unit", "gain_std": "gain_unit", "drop": "drop_unit", "condition": "condition_unit",
}  # fmt: skip
FUNCTION_KEYS = ("numerator", "denominator")  # what tells a fitted transfer function
_NOT_POINTS = (*FUNCTION_KEYS, "covariance", "coefficients")


def curves_of(named: Mapping[str, Any]) -> tuple[Curve, ...]:
    """Every table in `Findings.curves`; one that a procedure of a stranger made is taken apart by the same rules."""
    found: dict[str, Curve] = {}
    for curve in (curve for name, content in named.items() for curve in _tables(name, content, {})):
        name, number = curve.name, 2
        while name in found:
            name, number = f"{curve.name} ({number})", number + 1
        found[name] = curve.model_copy(update={"name": name})
    return tuple(found.values())


def mappings_of(named: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """(name, mapping) of every mapping in `Findings.curves`, outer ones first; a label goes before a key."""
    for name, content in named.items():
        yield from _mappings(name, content)


def _mappings(name: str, content: Any) -> Iterator[tuple[str, Mapping[str, Any]]]:
    if isinstance(content, Mapping):
        own = _named(name, content)
        yield own, content
        for key, value in content.items():
            yield from _mappings(f"{own}, {_words(key)}", value)
    elif isinstance(content, list | tuple):
        for entry in content:
            yield from _mappings(name, entry)


def _tables(name: str, content: Any, units: Mapping[str, str]) -> Iterator[Curve]:
    for own, mapping in _mappings(name, content):
        units = {**units, **{key: value for key, value in mapping.items() if key.endswith("_unit") and value}}
        columns = {key: np.asarray(value) for key, value in mapping.items() if _is_points(key, value)}
        if "gain" in columns and "magnitude_db" in columns:  # the second is relative to the reference frequency
            columns["raw_magnitude_db"] = decibels(columns["gain"])
        yield from _of_one_length(own, columns, units)


def _of_one_length(name: str, columns: Mapping[str, Array], units: Mapping[str, str]) -> Iterator[Curve]:
    """A table for each length that occurs; the first has the name, another that of its first column too."""
    lengths = list(dict.fromkeys(len(values) for values in columns.values()))
    for number, length in enumerate(lengths):
        mine = {key: values for key, values in columns.items() if len(values) == length}
        heads = tuple(_column(key, units) for key in mine)
        cells = [plain(np.asarray(values, float)) for values in mine.values()]
        rows = tuple(zip(*cells, strict=True))
        yield Curve(name=name if number == 0 else f"{name}, {heads[0].name}", columns=heads, rows=rows)


def _column(key: str, units: Mapping[str, str]) -> ColumnOf:
    if key in _UNIT_KEYS:
        return ColumnOf(name=_words(key), unit=units.get(_UNIT_KEYS[key], "1"))
    name, unit = split_unit(key)
    return ColumnOf(name=name, unit=unit or "1")


def _named(name: str, mapping: Mapping[str, Any]) -> str:
    label, frequency_hz = mapping.get("label"), mapping.get("frequency_hz")
    if isinstance(label, str) and label:
        return f"{name}, {label}"
    return f"{name}, {frequency_hz:g} Hz" if _is_number(frequency_hz) else name


def _is_points(key: str, value: Any) -> bool:
    if key in _NOT_POINTS or not isinstance(value, np.ndarray | list):
        return False
    array = np.asarray(value) if isinstance(value, np.ndarray) or all(_is_number(v) for v in value) else None
    return array is not None and array.ndim == 1 and array.size > 1 and array.dtype.kind in "iuf"


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)


def _words(key: str) -> str:
    return key.replace("_", " ")
