"""CSV, the contract's format: header `name [unit]`, `time [s]` first, one row per sample; `.csv.gz` too.

Spreadsheets' dialects are read as well: semicolons or tabs with a decimal comma, `sep=;`, quoted headings, a
byte order mark, a separator at the end of each line.
"""

from __future__ import annotations

import csv
import gzip
import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import IO, Literal

import numpy as np

from hil.errors import FileError, UnitError
from hil.record.columns import is_time
from hil.record.recording import Array, Channel, Recording, check, split_heading
from hil.units import convert

SUFFIXES = (".csv", ".csv.gz")
_GZIP_LEVEL = 3  # noise shrinks by 3 % more at level 9, for more than twice the time
_ROWS_AT_ONCE = 10_000


@dataclass(frozen=True, slots=True)
class _Dialect:
    """How a file is written: its encoding, what stands between columns, and the line of its headings."""

    encoding: str
    separator: str
    heading_line: int
    headings: tuple[str, ...]


def read(path: Path) -> Recording:
    """Read a recording.

    A first column `sample [1]` stands for an even time base that the file does not state; one second per
    sample is taken and `meta["time_base"]` says so.

    Raises:
        FileError: names the file, the line and the column, and what was expected there.
    """
    try:
        dialect = _dialect(path)
        columns = _columns(path, dialect)
    except (OSError, EOFError, UnicodeError) as error:
        raise FileError(f"{path}: cannot be read as CSV: {error}") from error
    place = f"{path}: line {dialect.heading_line}"
    names = [_heading(f"{place}, column {i}", text) for i, text in enumerate(dialect.headings, 1)]
    time_s, meta = _time(place, *names[0], columns[0])
    channels = {}
    for (name, unit), values in zip(names[1:], columns[1:], strict=True):
        if name in channels:
            raise FileError(f"{place}: two columns are named '{name}'")
        channels[name] = Channel(name, unit, values)
    found = Recording(str(path), time_s, channels, meta)
    check(found, place=lambda row: f"line {_line_of(path, dialect, row)}")
    return found


def write(recording: Recording, path: Path) -> None:
    """Write a recording; every number in the fewest digits that give it back exactly."""
    columns = [recording.time_s, *(channel.values for channel in recording.channels.values())]
    with _open(path, "utf-8", "wt") as file:
        headings = ["time [s]", *(channel.heading for channel in recording.channels.values())]
        csv.writer(file, lineterminator="\n").writerow(headings)
        for start in range(0, len(recording), _ROWS_AT_ONCE):
            rows = np.stack([column[start : start + _ROWS_AT_ONCE] for column in columns], axis=1).tolist()
            file.writelines(",".join(map(repr, row)) + "\n" for row in rows)


def _open(path: Path, encoding: str, mode: Literal["rt", "wt"] = "rt") -> IO[str]:
    if path.suffix.lower() == ".gz":
        return gzip.open(path, mode, _GZIP_LEVEL, encoding=encoding)
    return path.open(mode, encoding=encoding)


def _dialect(path: Path) -> _Dialect:
    encoding = _encoding(path)
    with _open(path, encoding) as file:
        line, number = file.readline(), 1
        if line.lower().startswith("sep="):  # a hint for spreadsheets
            line, number = file.readline(), 2
    separator = _separator(line)
    headings = _split(line, separator)
    if len(headings) > 1 and not headings[-1].strip():
        headings.pop()
    return _Dialect(encoding, separator, number, tuple(headings))


def _separator(line: str) -> str:
    # A heading may hold any of the marks itself, so the right one is that which leaves `name [unit]` everywhere.
    for mark in ",;\t":
        headings = [text for text in _split(line, mark) if text.strip()]
        if len(headings) > 1 and all(text.count("[") == 1 for text in headings):
            return mark
    return next((mark for mark in ";\t" if mark in line), ",")


def _split(line: str, separator: str) -> list[str]:
    return next(csv.reader([line.strip("\r\n")], delimiter=separator), [])


def _encoding(path: Path) -> str:
    with _open(path, "latin-1") as file:
        start = file.readline().encode("latin-1")
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    try:
        start.decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"  # what spreadsheets write in Western Europe: a degree sign is enough
    return "utf-8-sig"


def _heading(place: str, text: str) -> tuple[str, str]:
    try:
        return split_heading(text)
    except UnitError as error:
        raise FileError(f"{place}: {error}") from None


def _columns(path: Path, dialect: _Dialect) -> list[Array]:
    wanted = len(dialect.headings)
    with _open(path, dialect.encoding) as file, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a file without rows gets our own error below
        try:
            table = np.loadtxt(
                _rows(file, dialect), delimiter=dialect.separator, ndmin=2, comments=None, quotechar='"',
                dtype=np.float64,
            )  # fmt: skip
        except ValueError as error:
            raise FileError(f"{path}: {_explained(str(error), path, dialect)}") from None
    if table.size == 0:
        raise FileError(f"{path}: no rows after the header")
    if table.shape[1] != wanted:
        line = _line_of(path, dialect, 0)
        raise FileError(f"{path}: line {line} {_miscounted(table.shape[1], dialect)}")
    return [np.ascontiguousarray(column) for column in table.T]


def _rows(file: IO[str], dialect: _Dialect) -> Iterator[str]:
    for _ in range(dialect.heading_line):
        file.readline()
    first = file.readline()
    lines: Iterator[str] = chain([first], file)
    if first.rstrip("\r\n").endswith(dialect.separator):
        lines = (line.rstrip("\r\n").removesuffix(dialect.separator) for line in lines)
    if dialect.separator != ",":
        lines = (line.replace(",", ".") for line in lines)
    return lines


def _explained(message: str, path: Path, dialect: _Dialect) -> str:
    # numpy counts rows of data from 0 in one message and from 1 in the other, without blank lines
    if found := re.search(r"could not convert string '(.*)' to \w+ at row (\d+), column (\d+)", message):
        what = f"'{found[1]}' is not a number" if found[1].strip() else "the field is empty"
        return f"line {_line_of(path, dialect, int(found[2]))}, column {found[3]}: {what}"
    if found := re.search(r"number of columns changed from \d+ to (\d+) at row (\d+)", message):
        return f"line {_line_of(path, dialect, int(found[2]) - 1)} {_miscounted(int(found[1]), dialect)}"
    return message


def _miscounted(found: int, dialect: _Dialect) -> str:
    wanted = len(dialect.headings)
    hint = "; with decimal commas, put semicolons between the columns" if found == 2 * wanted else ""
    return f"has {found} values, the header names {wanted} columns{hint}"


def _line_of(path: Path, dialect: _Dialect, row: int) -> int:
    with _open(path, dialect.encoding) as file:
        numbers = (number for number, line in enumerate(file, 1) if number > dialect.heading_line and line.strip())
        return next(number for i, number in enumerate(numbers) if i == row)


def _time(place: str, name: str, unit: str, values: Array) -> tuple[Array, dict[str, str]]:
    if name == "sample" and unit == "1":
        return values - values[0], {"time_base": "sample number; 1 s per sample assumed"}
    if not is_time(name):
        raise FileError(f"{place}, column 1: 'time [s]' was expected, found '{name} [{unit}]'")
    try:
        return convert(values, unit, "s"), {}
    except UnitError as error:
        raise FileError(f"{place}, column 1: {error}") from None
