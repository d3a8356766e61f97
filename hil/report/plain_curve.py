"""Curves that this program does not know: numbers as a table, arrays over the first array."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.language.words import _
from hil.record.recording import Array
from hil.report.figure import DASHES, SERIES, Picture, drawn, legend_above, thinned
from hil.report.name import picture_name, words
from hil.report.number import number
from hil.report.section import Section, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_PICTURES = 12
_MOST_ROWS = 60


def plain_section(name: str, curve: Any) -> Section:
    """Whatever a procedure hands over: its arrays drawn, its numbers and words in a table."""
    pictures: list[Picture] = []
    rows: list[tuple[str, str]] = []
    for label, entry in _entries(curve):
        lines, values = _split(entry)
        pictures += _pictures(name, label, lines)
        rows += [(f"{label}: {words(key)}" if label else words(key), text) for key, text in values.items()]
    tables = (Table("", (_("Quantity"), _("Value")), tuple(rows[:_MOST_ROWS])),) if rows else ()
    return Section(words(name, capital=True), figures=tuple(pictures[:_MOST_PICTURES]), tables=tables)


def _entries(curve: Any) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """(label, fields) of each thing to draw."""
    if _is_array(curve):
        yield "", {"value": curve}
    elif is_dataclass(curve) and not isinstance(curve, type):
        yield "", {field.name: getattr(curve, field.name) for field in fields(curve)}
    elif isinstance(curve, Mapping) and curve and all(_is_nested(v) for v in curve.values()):
        for key, value in curve.items():
            yield from ((" ".join(filter(None, (words(str(key)), label))), entry) for label, entry in _entries(value))
    elif isinstance(curve, Mapping):
        yield "", curve
    elif isinstance(curve, list | tuple) and curve and all(_is_nested(v) for v in curve):
        for i, value in enumerate(curve, 1):
            named = isinstance(value, Mapping) and value.get("label")
            own = f"{i}: {named}" if named else str(i)
            yield from ((" ".join(filter(None, (own, label))), entry) for label, entry in _entries(value))
    elif curve is not None:
        yield "", {"value": curve}


def _is_nested(value: Any) -> bool:
    return isinstance(value, Mapping) or (is_dataclass(value) and not isinstance(value, type))


def _is_array(value: Any) -> bool:
    if not isinstance(value, np.ndarray | list | tuple):
        return False
    array = np.asarray(value) if isinstance(value, np.ndarray) or _all_numbers(value) else None
    return array is not None and array.ndim == 1 and array.size > 1 and array.dtype.kind in "iufc"


def _all_numbers(values: list[Any] | tuple[Any, ...]) -> bool:
    return all(isinstance(v, int | float | complex | np.number) and not isinstance(v, bool) for v in values)


def _split(entry: Mapping[str, Any]) -> tuple[dict[str, Array], dict[str, str]]:
    """Arrays as lines (complex ones as their size), everything else as text."""
    lines: dict[str, Array] = {}
    values: dict[str, str] = {}
    for key, value in entry.items():
        if _is_array(value):
            array = np.asarray(value)
            if array.dtype.kind == "c":
                lines[f"|{key}|"] = np.abs(array)
            else:
                lines[str(key)] = array.astype(np.float64)
        elif isinstance(value, np.ndarray):
            values[str(key)] = _("array of {shape}").format(shape=" × ".join(map(str, value.shape)))
        elif value is not None and not _is_nested(value):
            values[str(key)] = number(float(value)) if _is_number(value) else str(value)
    return lines, values


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)


def _pictures(name: str, label: str, lines: Mapping[str, Array]) -> list[Picture]:
    """All lines as long as the first one over it; the first alone over its index."""
    if not lines:
        return []
    x_name, x = next(iter(lines.items()))
    drawable = {key: y for key, y in lines.items() if key != x_name and len(y) == len(x) and np.isfinite(y).any()}
    if not drawable:
        x_name, x, drawable = _("index"), np.arange(len(x), dtype=np.float64), {x_name: x}

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, (key, y) in enumerate(drawable.items()):
            style = {"color": SERIES[k % len(SERIES)], "ls": DASHES[k % len(DASHES)]}
            axes.plot(*thinned(x, y), label=words(key), **style)  # type: ignore[arg-type]
        axes.set_xlabel(words(x_name))
        axes.set_ylabel(words(next(iter(drawable))) if len(drawable) == 1 else "")
        if len(drawable) > 1:
            legend_above(axes)

    return [drawn(picture_name(name, label), 2.8, draw, label[:1].upper() + label[1:])]
