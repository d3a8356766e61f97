"""Curves that this program does not know, as `results.json` has them: tables over their first column, and numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.findings.curves import curves_of, mappings_of
from hil.findings.results import Curve
from hil.language.words import _
from hil.report.figure import DASHES, MOST_DRAWN, SERIES, Picture, drawn, legend_above, thinned
from hil.report.name import capital, picture_name, words
from hil.report.number import number
from hil.report.section import Section, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_ROWS = 60


def plain_section(name: str, curve: Any) -> Section:
    """The arrays of whatever mappings a procedure hands over, drawn; their numbers and texts in a table."""
    pictures = tuple(_picture(name, one) for one in curves_of({name: curve})[:MOST_DRAWN])
    rows = [row for own, mapping in mappings_of({name: curve}) for row in _rows(_label(name, own), mapping)]
    tables = (Table("", (_("Quantity"), _("Value")), tuple(rows[:_MOST_ROWS])),) if rows else ()
    return Section(capital(words(name)), figures=pictures, tables=tables)


def _label(name: str, own: str) -> str:
    return own.removeprefix(name).removeprefix(", ")


def _rows(label: str, mapping: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for key, value in mapping.items():
        if key == "label" or key.endswith("_unit") or not isinstance(value, str | bool | int | float | np.number):
            continue
        text = str(value) if isinstance(value, str | bool) else number(float(value))
        yield f"{label}: {words(key)}" if label else words(key), text


def _picture(name: str, curve: Curve) -> Picture:
    """All columns over the first; the first alone over its index."""
    first, *others = curve.columns
    x = curve.array(first.name) if others else np.arange(len(curve.rows), dtype=np.float64)
    across = f"{first.name} [{first.unit}]" if others else _("index")

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, column in enumerate(others or [first]):
            style = {"color": SERIES[k % len(SERIES)], "ls": DASHES[k % len(DASHES)]}
            heading = f"{column.name} [{column.unit}]"
            axes.plot(*thinned(x, curve.array(column.name)), label=heading, **style)  # type: ignore[arg-type]
        axes.set_xlabel(across)
        if len(others) > 1:
            legend_above(axes)
        else:
            axes.set_ylabel(heading)

    return drawn(picture_name(curve.name), 2.8, draw, capital(_label(name, curve.name)))
