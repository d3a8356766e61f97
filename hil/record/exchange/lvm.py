"""LabVIEW measurement files, `.lvm`: one, none or several columns of time, decimal point or comma."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.errors import FileError
from hil.record.assemble import assemble
from hil.record.columns import Column, Table
from hil.record.heading import split as split_heading
from hil.record.layout import Kind, Layout, split
from hil.record.reading import AS_IT_IS, Reading
from hil.record.recording import Array, Recording
from hil.record.response_table import ResponseTable
from hil.record.text_file import encoding_of, open_text
from hil.record.text_rows import columns, place
from hil.record.tokens import decimal_and_thousands, stamps

SUFFIXES = (".lvm",)
BEGINNINGS = (b"LabVIEW Measurement",)
_BEGINNING, _END = "LabVIEW Measurement", "***End_of_Header***"
_REMARK, _TIME = "Comment", "X_Value"


def read(path: Path, reading: Reading = AS_IT_IS) -> Recording | ResponseTable:
    """Read a recording; segments that were written one after another are joined at their times.

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
    segments = [_segment(path, encoding, lines, header, reading) for header in _Header.all_of(lines, ends)]
    first = segments[0]
    tables, joined = joined_segments([segment.tables for segment in segments], [s.header.start for s in segments])
    notes = [text for text in (first.cut, joined, "" if joined else first.header.more) if text]
    meta = {"assumed": notes} if notes else None
    return assemble(str(path), tables, meta, reading, partial(place, path, first.layout))


@dataclass(frozen=True, slots=True, eq=False)
class _Segment:
    """What was written at one time: its header, how it is laid out, its tables, and what was left out of them."""

    header: _Header
    layout: Layout
    tables: list[Table]
    cut: str


def _segment(path: Path, encoding: str, lines: Sequence[str], header: _Header, reading: Reading) -> _Segment:
    read_columns, cut, found = columns(path, _layout(encoding, lines, header), reading)
    return _Segment(header, found, _tables(path.stem, read_columns, header), cut)


def joined_segments(segments: Sequence[list[Table]], starts: Sequence[NDArray[Any]]) -> tuple[list[Table], str]:
    """The tables of all segments as one, at their times, and that they were joined; of the first where that cannot be.

    Args:
        segments: the tables of each, with the same headings in all.
        starts: when each began, shape (1,); empty where its header does not say.
    """
    first = segments[0]
    if len(segments) < 2 or any(_headings(tables) != _headings(first) for tables in segments):
        return list(first), ""
    known = all(len(at) for at in starts)
    late = [float((at[0] - starts[0][0]) / np.timedelta64(1, "s")) if known else 0.0 for at in starts]
    made = [_joined(pieces, late) for pieces in zip(*segments, strict=True)]
    return (made, f"{len(segments)} segments joined at their times") if all(map(_goes_on, made)) else (list(first), "")


def _headings(tables: Sequence[Table]) -> list[list[str]]:
    return [[column.heading for column in table.columns if column.heading] for table in tables]


def _joined(pieces: Sequence[Table], late: Sequence[float]) -> Table:
    """Tables of one form one after another, each so many seconds late."""
    own = [piece.time_s + by for piece, by in zip(pieces, late, strict=True) if piece.time_s is not None]
    made = []
    for same in zip(*(piece.columns for piece in pieces), strict=False):
        clock = same[0].heading == _TIME
        values = [c.values + by if clock else c.values for c, by in zip(same, late, strict=True)]
        made.append(replace(same[0], values=np.concatenate(values)))
    return replace(pieces[0], columns=made, time_s=np.concatenate(own) if own else None)


def _goes_on(table: Table) -> bool:
    """Whether every time in a table increases."""
    clocks = [c.values for c in table.columns if c.heading == _TIME]
    clocks += [] if table.time_s is None else [table.time_s]
    return all(bool(np.all(np.diff(clock[~np.isnan(clock)]) > 0.0)) for clock in clocks)


class _Header:
    """What stands above the samples: single entries, entries per column, and where the headings are."""

    def __init__(self, single: dict[str, str], rows: dict[str, list[str]], at: int, stop: int | None) -> None:
        self.single, self.rows, self.at, self.stop = single, rows, at, stop

    @classmethod
    def all_of(cls, lines: Sequence[str], ends: Sequence[int]) -> list[_Header]:
        """That of each segment; all share the first lines of the file."""
        mark = "," if any(line.startswith("Separator,Comma") for line in lines[: ends[0]]) else "\t"
        single = {cells[0]: cells[1] for line in lines[: ends[0]] if len(cells := split(line, mark)) > 1}
        last = ends[1] if len(ends) > 1 else ends[0]
        begins = [ends[0] + 1, *(i for i in range(last + 2, len(lines)) if lines[i].startswith("Channels"))]
        made = []
        for begin, stop in zip(begins, [*begins[1:], None], strict=True):
            end = next((i for i in ends[1:] if i > begin), ends[0]) if len(ends) > 1 else ends[0]
            rows = {cells[0]: cells for line in lines[begin:end] if (cells := split(line, mark)) and cells[0]}
            made.append(cls({**single, "mark": mark}, rows, end + 1, stop))
        return made

    @property
    def start(self) -> NDArray[Any]:
        """When the segment began; empty where that is not said."""
        days, clocks = (self.rows.get(key, self.single.get(key, "")) for key in ("Date", "Time"))
        day, clock = (text if isinstance(text, str) else "".join(text[1:2]) for text in (days, clocks))
        return _stamps_of([(day, clock)]) if day and clock else np.empty(0, dtype="M8[ns]")

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


def _layout(encoding: str, lines: Sequence[str], header: _Header) -> Layout:
    mark = header.single["mark"]
    headings = split(lines[header.at], mark)
    while headings and headings[-1] in ("", _REMARK):
        headings.pop()
    rows = [split(line, mark) for line in lines[header.at + 1 : header.at + 200] if line.strip()]
    wide = max((len(row) for row in rows), default=len(headings))
    spare = ("",) * max(0, wide - len(headings))
    decimal = header.single.get("Decimal_Separator") or decimal_and_thousands([c for row in rows for c in row])[0]
    named = [split_heading(heading) for heading in headings]
    units = tuple(
        ("s" if _is_clock(header, i, heading) else header.of_column("Y_Unit_Label", i) or unit)
        for i, (heading, unit) in enumerate(named)
    )
    names = (*(name for name, _ in named), *((_REMARK,) if spare else ()), *spare[1:])
    numbers: Kind = "number"
    texts: Kind = "text"
    kinds = (*(numbers for _ in headings), *(texts for _ in spare))
    count = None if header.stop is None else sum(1 for line in lines[header.at + 1 : header.stop] if line.strip())
    return Layout(
        encoding, mark, decimal, "", names, (*units, *spare), header.at + 1, header.at + 2, kinds, count
    )  # fmt: skip


def _is_clock(header: _Header, column: int, heading: str) -> bool:
    dimension = header.of_column("X_Dimension", column + 1)
    return heading == _TIME and dimension in ("", "Time")


def _tables(name: str, read: Sequence[Column], header: _Header) -> list[Table]:
    late_s = _starts_s(header, len(read))
    if header.single.get("X_Columns") != "No":
        moved = [_later(column, late_s, i) for i, column in enumerate(read) if column.heading != _REMARK]
        return [Table(name, moved)]
    made = []
    for i, column in enumerate(read):
        step = header.of_column("Delta_X", i).replace(",", ".")
        if column.heading in (_TIME, _REMARK) or not step or not column.is_number:
            continue
        first = float(header.of_column("X0", i).replace(",", ".") or 0.0)
        values = column.values[: _last(column.values) + 1]
        time_s: Array = first + late_s.get(i, 0.0) + float(step) * np.arange(len(values), dtype=np.float64)
        made.append(
            Table(name, [Column(column.heading, values, column.unit)], time_s, f"even time base, Delta_X = {step}")
        )
    return made


def _last(values: Any) -> int:
    filled = np.flatnonzero(~np.isnan(values))
    return int(filled[-1]) if filled.size else -1


def _starts_s(header: _Header, count: int) -> dict[int, float]:
    """By how much channels begin after the first of them, where their dates say so."""
    texts = {i: (header.of_column("Date", i), header.of_column("Time", i)) for i in range(1, count)}
    texts = {i: both for i, both in texts.items() if all(both)}
    if len(set(texts.values())) < 2:
        return {}
    found = _stamps_of(list(texts.values()))
    late = (found - found.min()) / np.timedelta64(1, "s")
    return dict(zip(texts, late.tolist(), strict=True))


def _stamps_of(texts: Sequence[tuple[str, str]]) -> NDArray[Any]:
    """Days and clocks, whose seconds may have more digits than a clock can hold, as stamps."""
    return stamps([f"{day.replace('/', '-')} {clock.replace(',', '.')[:15]}" for day, clock in texts])


def _later(column: Column, late_s: dict[int, float], i: int) -> Column:
    """A column of time, on the clock of all; where each channel has one it stands before that channel."""
    shift = late_s.get(i + 1, 0.0)
    if column.heading != _TIME or not shift or i == 0:
        return column
    return Column(column.heading, column.values + shift, column.unit)
