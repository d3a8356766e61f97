"""Text files whose lines above or beside the samples state their names, units and interval: scopes and recorders.

Tektronix' TDS and DPO series write such lines beside the first samples, Infiniium, Yokogawa, GW Instek, Hioki, Hantek,
OWON, dSPACE and SignalExpress above them. What counts is what a line is called, not who wrote it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from statistics import median

from hil.record.table import heading as headings
from hil.record.table.columns import Column, Table, even_times
from hil.record.table.tokens import decimal_and_thousands, is_blank, is_number, is_stamp
from hil.record.text.layout import Kind, Layout, is_row_of_units, split
from hil.record.text.text_file import Beginning
from hil.record.text.vendor_formats import Known
from hil.units import scale_and_offset

_LOOKED_AT = 120
_FEWEST_ROWS = 4
_INTERVALS, _RATES = headings.INTERVALS | {"clock"}, headings.RATES
_STARTS = frozenset({"xorg", "x origin", "xorigin", "hoffset"})
_TIME_UNITS = frozenset({"horizontal units", "horizontal unit", "hunit", "xunits", "x units", "x unit", "horz units"})
_UNITS = frozenset(
    {"vertical units", "vertical unit", "vunit", "yunits", "y units", "y unit", "vert units", "unit", "units"}
)
_NAMES = frozenset({
    "source", "tracename", "trace name", "signal", "signals", "signal name", "descriptor", "channel names", "channel",
    "channels", "",
})  # fmt: skip
_MODES = frozenset({"mode"})
_ALL = _MODES | _INTERVALS | _RATES | _STARTS | _TIME_UNITS | _UNITS | _NAMES
_INSIDE = re.compile(r"^(?P<label>[^:=]*[A-Za-z][^:=]*)[:=](?P<value>.+)$")
_VALUE = re.compile(r"^(?P<number>[-+\d.,]+([eE][-+]?\d+)?)\s*(?P<unit>[A-Za-zµμ]*)$")


@dataclass(frozen=True, slots=True)
class _Metadata:
    """What the lines state, by their labels in lower case, each with the number of its line."""

    entries: dict[str, tuple[int, list[str]]] = field(default_factory=dict)

    def first_of(self, labels: frozenset[str]) -> tuple[int, list[str]]:
        """Line and values of the first label among these; 0 and none where there is none."""
        return next((found for label, found in self.entries.items() if label in labels), (0, []))

    @property
    def time_unit(self) -> str:
        return headings.spelt_time_unit(next(iter(self.first_of(_TIME_UNITS)[1]), ""))

    def interval(self) -> tuple[float, str]:
        """The distance of samples in s, and what says so; 0 where nothing does."""
        for labels, is_rate in ((_INTERVALS, False), (_RATES, True)):
            line, values = self.first_of(labels)
            if found := _VALUE.match(next(iter(values), "")):
                value, unit = _number(found["number"]), found["unit"]
                timed = headings.is_time_unit(unit)
                value *= _size(unit) if timed else 1.0 if is_rate else _size(self.time_unit)
                if value > 0.0:
                    step_s = 1.0 / (value * _per_second(unit)) if is_rate and not timed else value
                    return step_s, f"even time base of {step_s:g} s, as line {line} says"
        return 0.0, ""

    def are_times(self, texts: Sequence[str]) -> bool:
        """Whether values go on as a time does, by the distance of samples where one is stated: numbers of rows do not.

        Never back, and on in most rows; a command that steps up stands.
        """
        values = [_number(text) for text in texts if text]
        steps = [later - before for before, later in pairwise(values)]
        if not steps or min(steps) < 0.0 or 2 * sum(step > 0.0 for step in steps) <= len(steps):
            return False
        interval_s = self.interval()[0]
        return not interval_s or abs(_size(self.time_unit) * median(steps) - interval_s) < interval_s / 2.0

    @property
    def start_s(self) -> float:
        values = self.first_of(_STARTS)[1]
        return _number(values[0]) * _size(self.time_unit) if values and is_number(values[0]) else 0.0

    @property
    def units(self) -> list[str]:
        """Units of the channels; of GW Instek's fast form none, whose samples are counts of the converter."""
        return [] if "fast" in map(str.casefold, self.first_of(_MODES)[1]) else self.first_of(_UNITS)[1]

    @property
    def is_enough(self) -> bool:
        """Whether it says how samples lie in time, or the unit of the time and others."""
        stated, names = self.units, self.first_of(_NAMES)[1]
        timed = self.time_unit != "" or (len(stated) == len(names) and _timed_unit(stated, len(names)))
        return self.interval()[0] > 0.0 or bool(stated and timed)


def _number(text: str) -> float:
    return float(text.replace(",", ".")) if is_number(text) else 0.0


def _size(unit: str) -> float:
    known = headings.spelt_time_unit(unit)
    return scale_and_offset(known, "s")[0] if known else 1.0


def _per_second(unit: str) -> float:
    return {"k": 1e3, "m": 1e6, "g": 1e9}.get(unit[:1].casefold(), 1.0) if len(unit) > 1 else 1.0


def of_header_lines(begun: Beginning) -> Known | None:
    """The layout of a file that says more above or beside its samples than its headings do; None for any other."""
    lines = begun.lines[:_LOOKED_AT]
    while lines and not lines[-1].strip():
        lines.pop()
    for mark in ",;\t" if lines else "":
        rows = [split(line.lstrip("#%"), mark) for line in lines]
        found = _metadata_beside(begun.encoding, mark, rows) or _metadata_above(begun.encoding, mark, rows)
        if found:
            return found
    return None


def units_above(lines: Sequence[str], mark: str, cells: Sequence[str]) -> tuple[str, ...]:
    """Units that lines above state for the columns of a row of headings; empty texts where they state none."""
    none = ("",) * len(cells)
    if len(mark) > 1:
        return none
    metadata = _metadata([split(line.lstrip("#%"), mark) for line in lines])
    if not metadata.is_enough:
        return none
    stated = metadata.units
    clocks = [headings.is_time(headings.split(cell)[0]) for cell in cells]
    if len(stated) != len(cells) - sum(clocks) or sum(clocks) != 1:
        return none
    rest = iter(stated)
    return tuple(metadata.time_unit if clock else next(rest) for clock in clocks)


def _metadata_beside(encoding: str, mark: str, rows: Sequence[Sequence[str]]) -> Known | None:
    """Lines that say something stand in the first columns, beside the first samples."""
    if len(rows) < 2 * _FEWEST_ROWS:
        return None
    blank = min(_leading_blanks(row) for row in rows[-_FEWEST_ROWS:])
    width = len(rows[-1])
    if not 1 < blank < width or any(len(row) != width or not _is_samples(row[blank:]) for row in rows):
        return None
    metadata = _metadata([row[:blank] for row in rows])
    return _known(encoding, mark, rows, 0, metadata, None) if metadata.is_enough else None


def _metadata_above(encoding: str, mark: str, rows: Sequence[Sequence[str]]) -> Known | None:
    width = len(rows[-1])
    first = len(rows)
    while first and len(rows[first - 1]) == width and _is_samples(rows[first - 1]):
        first -= 1
    if len(rows) - first < _FEWEST_ROWS or not first:
        return None
    metadata = _metadata(rows[:first])
    if not metadata.is_enough:
        return None
    if any(_is_timed_heading(row) for row in rows[:first] if len(_trimmed(row)) > 1 and not _is_stated(row)):
        return None  # its headings say the time: they are read as any others
    last = next((row for row in reversed(rows[:first]) if any(row)), [])
    if is_row_of_units(last):
        return None
    return _known(encoding, mark, rows, first, metadata, last if _is_heading(last, len(_trimmed(rows[-1]))) else None)


def _known(
    encoding: str,
    mark: str,
    rows: Sequence[Sequence[str]],
    first: int,
    metadata: _Metadata,
    heading: Sequence[str] | None,
) -> Known | None:
    """The layout of the columns that hold samples, and the table or tables that they are."""
    samples = rows[first:]
    width = len(rows[-1])
    at = [i for i in range(width) if not all(is_blank(row[i]) for row in samples[-_FEWEST_ROWS:])]
    interval_s, words = metadata.interval()
    names = [heading[i] for i in at] if heading is not None else metadata.first_of(_NAMES)[1]
    found = _columns(len(at), names, metadata, interval_s, metadata.are_times([row[at[0]] for row in samples]))
    if found is None:
        return None
    called, units, timed = found
    by_place = {place: (name, unit) for place, name, unit in zip(at, called, units, strict=True)}
    headings, of_columns = zip(*(by_place.get(i, ("", "")) for i in range(width)), strict=True)
    kinds: tuple[Kind, ...] = tuple("number" if i in by_place else "text" for i in range(width))
    decimal = "." if mark == "," else decimal_and_thousands([c for row in samples for c in row])[0]
    made = Layout(encoding, mark, decimal, "", headings, of_columns, first + 1, kinds)
    return Known(made, partial(_tables, at, (metadata.start_s, 0.0 if timed else interval_s, words)))


def _columns(
    count: int, names: Sequence[str], metadata: _Metadata, interval_s: float, rises: bool
) -> tuple[list[str], list[str], bool] | None:
    """Names and units of so many columns of samples, and whether times are among them; None where nothing fits."""
    stated = metadata.units
    if len(names) == count:
        timed = any(map(headings.is_time, names)) or _timed_unit(stated, count)
        return (list(names), _filled(stated, count), timed) if timed or interval_s else None
    channels = len(names) or len(stated) or (count - 1 if rises else count)
    names = list(names) or ([f"channel {i}" for i in range(1, channels + 1)] if channels > 1 else ["channel"])
    units, of_time = _filled(stated, channels), metadata.time_unit or "s"
    if count == channels + 1 and (has_time := any(map(headings.is_time, names))):
        return ["#", *names], ["", *units], has_time  # what stands below the labels numbers the rows
    if count == channels + 1 and rises:
        return ["time", *names], [of_time, *units], True
    if count == 2 * channels and rises:  # each at its own times
        called = [text for name in names for text in ("time", name)]
        return called, [text for unit in units for text in (of_time, unit)], True
    return (names, units, False) if count == channels and interval_s else None


def _timed_unit(stated: Sequence[str], count: int) -> bool:
    return len(stated) == count > 0 and headings.is_time_unit(stated[0])


def _filled(stated: Sequence[str], count: int) -> list[str]:
    return list(stated) if len(stated) == count else [""] * count


def _tables(at: Sequence[int], clock: tuple[float, float, str], columns: Sequence[Column]) -> list[Table]:
    """The columns at these places as one table; `clock`: where an even time base starts, its step in s, what says so.

    A step of 0 stands for times among the columns.
    """
    read = [columns[i] for i in at]
    start_s, step_s, words = clock
    if not step_s:
        return [Table("", read)]
    time_s = even_times(len(read[0].values), step_s, start_s)
    return [Table("", [column for column in read if not column.counts_rows], time_s, words)]


def _metadata(rows: Sequence[Sequence[str]]) -> _Metadata:
    found = _Metadata()
    for number, row in enumerate(rows, 1):
        cells = _inside(_trimmed(row))
        if not cells:
            continue
        label, values = headings.plain_name(cells[0]), cells[1:]
        if not values and cells[0].endswith(":") and number < len(rows):
            values = _trimmed(rows[number])
        named = label in _NAMES and not all(value and not is_number(value) for value in values)
        if label in _ALL and values and not named:
            found.entries.setdefault(label, (number, list(values)))
    return found


def _inside(cells: Sequence[str]) -> list[str]:
    """A label and its value that share a field, `XInc:1e-3`, as two."""
    match = _INSIDE.match(cells[0]) if cells else None
    if match and headings.plain_name(match["label"]) in _ALL:
        return [match["label"], match["value"].strip(), *cells[1:]]
    return list(cells)


def _is_stated(row: Sequence[str]) -> bool:
    cells = _inside(_trimmed(row))
    return bool(cells) and (headings.plain_name(cells[0]) in _ALL - {""} or any(map(is_stamp, cells[1:])))


def _is_timed_heading(row: Sequence[str]) -> bool:
    cells = [cell for cell in row if cell]
    return any(headings.is_time(headings.split(cell)[0]) for cell in cells) and not any(map(is_stamp, cells))


def _is_heading(row: Sequence[str], count: int) -> bool:
    cells = _trimmed(row)
    named = all(cell and not is_number(cell) and not cell.endswith(":") for cell in cells)
    return len(cells) == count > 1 and named and not _is_stated(row)


def _is_samples(cells: Sequence[str]) -> bool:
    return any(map(is_number, cells)) and all(is_number(cell) or is_blank(cell) for cell in cells)


def _leading_blanks(row: Sequence[str]) -> int:
    return next((i for i, cell in enumerate(row) if cell), len(row))


def _trimmed(row: Sequence[str]) -> list[str]:
    cells = list(row)
    while cells and not cells[-1]:
        cells.pop()
    return cells
