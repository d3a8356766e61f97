"""LabVIEW measurement files, `.lvm`: one, none or several columns of time, decimal point or comma."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from hil.errors import FileError
from hil.record.assemble import assemble
from hil.record.columns import Column, Table
from hil.record.heading import split as split_heading
from hil.record.layout import Kind, Layout, encoding_of, open_text, split
from hil.record.reading import AS_IT_IS, Reading
from hil.record.recording import Array, Recording
from hil.record.response_table import ResponseTable
from hil.record.text_rows import columns, place
from hil.record.tokens import decimal_and_thousands, stamps

SUFFIXES = (".lvm",)
BEGINNINGS = (b"LabVIEW Measurement",)
_BEGINNING, _END = "LabVIEW Measurement", "***End_of_Header***"
_REMARK, _TIME = "Comment", "X_Value"


def read(path: Path, reading: Reading = AS_IT_IS) -> Recording | ResponseTable:
    """Read a recording; where several were written one after another, the first.

    Raises:
        FileError: no such file, or without a time and a signal; names line and column.
    """
    try:
        encoding = encoding_of(path)
        with open_text(path, encoding) as file:
            lines = [line.rstrip("\r\n") for line in file]
    except (OSError, UnicodeError) as error:
        raise FileError(f"{path}: cannot be read as LVM: {error}") from None
    ends = [i for i, line in enumerate(lines) if line.startswith(_END)]
    if not lines[0].startswith(_BEGINNING) or not ends:
        raise FileError(f"{path}: cannot be read as LVM: it does not begin with '{_BEGINNING}' and a header")
    said = _Header.of(lines, ends)
    found = _layout(encoding, lines, said)
    read_columns, cut, found = columns(path, found, reading.gaps)
    tables = _tables(path.stem, read_columns, said)
    notes = [text for text in (cut, said.more) if text]
    meta = {"assumed": notes} if notes else None
    return assemble(str(path), tables, meta, reading, partial(place, path, found))


class _Header:
    """What stands above the samples: single entries, entries per column, and where the headings are."""

    def __init__(self, single: dict[str, str], rows: dict[str, list[str]], at: int, stop: int | None) -> None:
        self.single, self.rows, self.at, self.stop = single, rows, at, stop

    @classmethod
    def of(cls, lines: Sequence[str], ends: Sequence[int]) -> _Header:
        mark = "," if any(line.startswith("Separator,Comma") for line in lines[: ends[0]]) else "\t"
        single = {cells[0]: cells[1] for line in lines[: ends[0]] if len(cells := split(line, mark)) > 1}
        last = ends[1] if len(ends) > 1 else ends[0]
        rows = {cells[0]: cells for line in lines[ends[0] + 1 : last] if (cells := split(line, mark)) and cells[0]}
        again = next((i for i in range(last + 2, len(lines)) if lines[i].startswith(("Channels", _END))), None)
        return cls({**single, "mark": mark}, rows, last + 1, again)

    @property
    def more(self) -> str:
        """That more follows which is not read."""
        return (
            f"only the first recording of the file is read; another begins at line {self.stop + 1}" if self.stop else ""
        )

    def of_column(self, key: str, column: int) -> str:
        """An entry of a column, empty where there is none."""
        cells = self.rows.get(key, [])
        return cells[column] if 0 < column < len(cells) else ""


def _layout(encoding: str, lines: Sequence[str], said: _Header) -> Layout:
    mark = said.single["mark"]
    headings = split(lines[said.at], mark)
    while headings and headings[-1] in ("", _REMARK):
        headings.pop()
    rows = [split(line, mark) for line in lines[said.at + 1 : said.at + 200] if line.strip()]
    wide = max((len(row) for row in rows), default=len(headings))
    spare = ("",) * max(0, wide - len(headings))
    decimal = said.single.get("Decimal_Separator") or decimal_and_thousands([c for row in rows for c in row])[0]
    named = [split_heading(heading) for heading in headings]
    units = tuple(
        ("s" if _is_clock(said, i, heading) else said.of_column("Y_Unit_Label", i) or unit)
        for i, (heading, unit) in enumerate(named)
    )
    names = (*(name for name, _ in named), *((_REMARK,) if spare else ()), *spare[1:])
    numbers: Kind = "number"
    texts: Kind = "text"
    kinds = (*(numbers for _ in headings), *(texts for _ in spare))
    count = None if said.stop is None else sum(1 for line in lines[said.at + 1 : said.stop] if line.strip())
    return Layout(
        encoding, mark, decimal, "", names, (*units, *spare), said.at + 1, said.at + 2, kinds, count
    )  # fmt: skip


def _is_clock(said: _Header, column: int, heading: str) -> bool:
    dimension = said.of_column("X_Dimension", column + 1)
    return heading == _TIME and dimension in ("", "Time")


def _tables(name: str, read: Sequence[Column], said: _Header) -> list[Table]:
    late_s = _starts_s(said, len(read))
    if said.single.get("X_Columns") != "No":
        moved = [_later(column, late_s, i) for i, column in enumerate(read) if column.heading != _REMARK]
        return [Table(name, moved)]
    made = []
    for i, column in enumerate(read):
        step = said.of_column("Delta_X", i).replace(",", ".")
        if column.heading in (_TIME, _REMARK) or not step or not column.is_number:
            continue
        first = float(said.of_column("X0", i).replace(",", ".") or 0.0)
        values = column.values[: _last(column.values) + 1]
        time_s: Array = first + late_s.get(i, 0.0) + float(step) * np.arange(len(values), dtype=np.float64)
        made.append(
            Table(name, [Column(column.heading, values, column.unit)], time_s, f"even time base, Delta_X = {step}")
        )
    return made


def _last(values: Any) -> int:
    filled = np.flatnonzero(~np.isnan(values))
    return int(filled[-1]) if filled.size else -1


def _starts_s(said: _Header, count: int) -> dict[int, float]:
    """By how much channels begin after the first of them, where their dates say so."""
    texts = {i: (said.of_column("Date", i), said.of_column("Time", i)) for i in range(1, count)}
    texts = {i: (day, clock.replace(",", ".")[:15]) for i, (day, clock) in texts.items() if day and clock}
    if len(set(texts.values())) < 2:
        return {}
    found = stamps([f"{day.replace('/', '-')} {clock}" for day, clock in texts.values()])
    late = (found - found.min()) / np.timedelta64(1, "s")
    return dict(zip(texts, late.tolist(), strict=True))


def _later(column: Column, late_s: dict[int, float], i: int) -> Column:
    """A column of time, on the clock of all; where each channel has one it stands before that channel."""
    shift = late_s.get(i + 1, 0.0)
    if column.heading != _TIME or not shift or i == 0:
        return column
    return Column(column.heading, column.values + shift, column.unit)
