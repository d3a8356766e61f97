"""LabVIEW measurement files, `.lvm`, read only: one, none or several columns of time, decimal point or comma."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.errors import FileError, reason
from hil.record.extra import library
from hil.record.reading import AS_IT_IS, Reading
from hil.record.recording import Recording
from hil.record.table.assemble import assemble
from hil.record.table.columns import Column, Table, even_times
from hil.record.table.heading import split as split_heading
from hil.record.table.response_table import ResponseTable
from hil.record.table.tokens import stamps
from hil.record.text.text_file import encoding_of, open_text

SUFFIXES = (".lvm",)
BEGINNING = rb"LabVIEW Measurement"
OR_TEXT = True
_REMARK, _TIME = "Comment", "X_Value"


def read(path: Path, reading: Reading = AS_IT_IS) -> Recording | ResponseTable:
    """Read a recording; segments that were written one after another are joined at their times.

    Raises:
        FileError: not such a file, or without a time and a signal.
    """
    try:
        with open_text(path, encoding_of(path)) as file:
            text = file.read()
    except (OSError, UnicodeError) as error:
        raise FileError(f"{path}: cannot be read as LVM: {error}") from None
    try:
        found = library("lvm_read", path).read_str(text)
        segments = [found[k] for k in range(found["Segments"])]
        tables = [_tables(path.stem, found.get("X_Columns") != "No", segment) for segment in segments]
    except (LookupError, SyntaxError, ValueError) as error:
        raise FileError(f"{path}: cannot be read as LVM: {reason(error)}") from None
    if fault := _text_at_an_end(text.splitlines()):
        raise FileError(f"{path}: {fault}")
    made, note = _joined_segments(tables, [_start(found, segment) for segment in segments])
    return assemble(str(path), made, {"assumed": [note]} if note else None, reading)


def _text_at_an_end(lines: Sequence[str]) -> str:
    """A cell behind the last number of a column that is none, with its line; empty where there is none.

    The library makes it a place without a value, and behind the last number these are where a shorter channel ends. A
    column of remarks, the last one, may hold anything.
    """
    headings: list[str] = []
    text: dict[int, str] = {}
    for at, line in enumerate(lines, 1):
        cells = [cell.strip() for cell in line.split("\t" if "\t" in line else ",")]
        if cells[0] == _TIME:
            headings = cells[: cells.index(_REMARK)] if _REMARK in cells else cells
        elif line.startswith("***") or (len(cells[0]) > len("-inf") and cells[0].isalpha()):  # of another segment
            headings = []
        for column, cell in enumerate(cells[: len(headings)] if cells[0] != _TIME else []):
            if _is_number(cell):
                text.pop(column, None)
            elif cell:
                text[column] = f"line {at}: '{cell:.40}' is no number; leave it empty where there is none"
    return next(iter(text.values()), "")


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _joined_segments(segments: Sequence[list[Table]], starts: Sequence[NDArray[Any]]) -> tuple[list[Table], str]:
    """The tables of all segments as one, at their times, else those of the first; and what was done, in words.

    Args:
        segments: the tables of each, with the same headings in all.
        starts: when each began, shape (1,); empty where its header does not say.
    """
    first = segments[0]
    if len(segments) < 2:
        return first, ""
    only = f"only the first of {len(segments)} recordings in the file is read"
    if any(_headings(tables) != _headings(first) for tables in segments):
        return first, only
    known = all(len(at) for at in starts)
    late = [float((at[0] - starts[0][0]) / np.timedelta64(1, "s")) if known else 0.0 for at in starts]
    made = [_joined(pieces, late) for pieces in zip(*segments, strict=True)]
    return (made, f"{len(segments)} segments joined at their times") if all(map(_goes_on, made)) else (first, only)


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


def _tables(name: str, timed: bool, segment: Mapping[str, Any]) -> list[Table]:
    """The tables of a segment: all columns with theirs of time, or where it has none, each channel on an even one."""
    names, first = segment["Channel names"], 0 if timed else 1
    late_s, columns, made = _starts_s(segment, first + len(names)), [], []
    for i, (heading, values) in enumerate(zip(names, segment["data"].T, strict=False), first):
        label, unit = split_heading(heading)
        if heading == _TIME:
            unit = "s" if _cell_of(segment, "X_Dimension", i + 1) in ("", "Time") else unit
            columns.append(Column(label, values + (late_s.get(i + 1, 0.0) if i else 0.0), unit))
        elif heading != _REMARK:
            column = Column(label, values, _cell_of(segment, "Y_Unit_Label", i) or unit)
            columns.append(column)
            if (step := _cell_of(segment, "Delta_X", i)) and not timed:
                filled = np.flatnonzero(~np.isnan(values))
                own = values[: int(filled[-1]) + 1 if filled.size else 0]
                start_s = float(np.nan_to_num(_cell_of(segment, "X0", i) or 0.0)) + late_s.get(i, 0.0)
                note = f"even time base, Delta_X = {step:g}"
                made.append(Table(name, [replace(column, values=own)], even_times(len(own), step, start_s), note))
    return [Table(name, columns)] if timed else made


def _cell_of(segment: Mapping[str, Any], key: str, column: int) -> Any:
    """An entry of a column of the file, the first of which is 0; empty where there is none."""
    cells = segment.get(key)
    return cells[column - 1] if isinstance(cells, list) and 0 < column <= len(cells) else ""


def _start(read: Mapping[str, Any], segment: Mapping[str, Any]) -> NDArray[Any]:
    """When a segment began; empty where that is not said."""
    day, clock = (_cell_of(segment, key, 1) or segment.get(key) or read.get(key) for key in ("Date", "Time"))
    both = isinstance(day, str) and isinstance(clock, str)
    return _stamps_of([(day, clock)]) if both and day and clock else np.empty(0, dtype="M8[ns]")


def _starts_s(segment: Mapping[str, Any], count: int) -> dict[int, float]:
    """By how much channels begin after the first of them, where their dates say so."""
    texts = {i: (_cell_of(segment, "Date", i), _cell_of(segment, "Time", i)) for i in range(1, count)}
    texts = {i: both for i, both in texts.items() if all(both)}
    if len(set(texts.values())) < 2:
        return {}
    found = _stamps_of(list(texts.values()))
    late = (found - found.min()) / np.timedelta64(1, "s")
    return dict(zip(texts, late.tolist(), strict=True))


def _stamps_of(texts: Sequence[tuple[str, str]]) -> NDArray[Any]:
    """Days and clocks, whose seconds may have more digits than a clock can hold, as stamps."""
    return stamps([f"{day.replace('/', '-')} {clock.replace(',', '.')[:15]}" for day, clock in texts])
