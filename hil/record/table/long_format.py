"""Tables with one row for each channel and stamp, as historians and panels write them, taken apart by channel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.arrays import Mask
from hil.record.table.columns import Column, Table
from hil.record.table.heading import SPREADSHEET_DAYS, plain_name

_NAMES = frozenset({
    "name", "tag", "tagname", "tag name", "varname", "var name", "channel", "channel name", "signal", "signal name",
    "variable", "sensor", "parameter", "point", "point name", "measurement", "metric", "item", "quantity", "kanal",
    "field", "nodeid", "node id",
})  # fmt: skip
_VALUES = frozenset({"value", "varvalue", "val", "wert", "valeur", "valor", "reading", "measured value", "messwert"})
_UNITS = frozenset({"unit", "units", "uom", "einheit", "eu", "engunit", "eng unit"})
_QUALITY = frozenset({"quality", "validity", "status", "statuscode", "status code", "opcquality", "q"})
_BAD = ("bad", "invalid", "uncertain")
_GOOD_OPC = 192  # of an OPC quality, and above
_SYSTEM = "$"  # begins the name of what a panel writes about itself: $RT_OFF$
_MOST = 256
# A panel of Siemens writes its `Time_ms` as days since 1899, times 10⁶, beside a clock of whole seconds.
_PANEL_CLOCK, _PANEL_DAY = "time ms", 1e6


def split_by_channel(tables: Sequence[Table]) -> tuple[Sequence[Table], bool]:
    """The tables with each channel in one of its own, and whether that had to be done."""
    if len(tables) != 1:
        return tables, False
    tables = (table,) = [replace(tables[0], columns=[_panel_clock(column) for column in tables[0].columns])]
    by_name = {plain_name(column.heading.partition("[")[0]): column for column in table.columns}
    names, values = (next((by_name[known] for known in by_name if known in kinds), None) for kinds in (_NAMES, _VALUES))
    if names is None or values is None or names.values.dtype.kind not in "OSU" or not values.is_number:
        return tables, False
    called = np.array([str(one) for one in names.values.tolist()])
    channels = list(dict.fromkeys(called.tolist()))
    if len(channels) > _MOST:
        return tables, False
    good, note = _rows_of_good_quality(by_name, called)
    units = next((by_name[known].values for known in by_name if known in _UNITS), None)
    clocks = _clocks(table.columns, by_name, (names, values))
    assumed = "; ".join(filter(None, (table.assumed, "one row for each channel and stamp; taken apart by name", note)))
    made = []
    for channel in channels:
        rows = (called == channel) & good
        if not rows.any() or channel.startswith(_SYSTEM):
            continue
        unit = "" if units is None else _unit(units[rows])
        own = [replace(clock, values=clock.values[rows]) for clock in clocks]
        made.append(Table(channel, [*own, Column(channel, values.values[rows], unit)], None, assumed))
    return (made, True) if made else (tables, False)


def _unit(texts: NDArray[Any]) -> str:
    found = {str(text).strip() for text in texts.tolist()} - {"nan", "None", ""}
    return found.pop() if len(found) == 1 else ""


def _rows_of_good_quality(by_name: dict[str, Column], called: NDArray[Any]) -> tuple[Mask, str]:
    """Rows that their quality does not call bad, and how many it does, in words."""
    kept = np.ones(len(called), dtype=np.bool_)
    for known in by_name.keys() & _QUALITY:
        values = by_name[known].values
        if values.dtype.kind in "OSU":
            texts = [str(one).strip().casefold() for one in values.tolist()]
            kept &= np.array([not text.startswith(_BAD) for text in texts])
        elif known == "validity":
            kept &= values == 1
        elif float(np.nanmax(values, initial=0.0)) >= _GOOD_OPC:
            kept &= values >= _GOOD_OPC
    own = np.array([name.startswith(_SYSTEM) for name in called.tolist()])
    lost = int(np.count_nonzero(~kept & ~own))
    return kept, f"{lost} rows of bad quality left out" if lost else ""


def _panel_clock(column: Column) -> Column:
    """A panel's clock in seconds; any other column as it is."""
    if plain_name(column.heading) != _PANEL_CLOCK or not column.is_number or not len(column.values):
        return column
    days = column.values / _PANEL_DAY
    return (
        replace(column, values=86_400.0 * (days - days[0]), unit="s")
        if SPREADSHEET_DAYS[0] < days[0] < SPREADSHEET_DAYS[1]
        else column
    )


def _clocks(columns: Sequence[Column], by_name: dict[str, Column], others: Sequence[Column]) -> list[Column]:
    panel = by_name.get(_PANEL_CLOCK)
    if panel is not None and panel.unit == "s":
        return [panel]
    left_out = _UNITS | _QUALITY
    return [
        column
        for column in columns
        if column not in others and plain_name(column.heading.partition("[")[0]) not in left_out
        and (column.is_number or (column.is_dated and column.values[0] != column.values[-1]))
    ]  # fmt: skip
