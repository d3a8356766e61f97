"""The rows of a text file of a known layout, as columns; what is wrong in them is named by line and column."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from hil.errors import FileError, option
from hil.record.reading import AS_IT_IS, Reading
from hil.record.table import heading as headings
from hil.record.table.columns import Column
from hil.record.table.tokens import (
    BLANKS,
    decimal_and_thousands,
    is_blank,
    is_date_only,
    is_number,
    is_stamp,
    joined,
    numbers,
    of_two_parts,
    prefixes,
    stamps,
    unit_of,
)
from hil.record.text.layout import Layout
from hil.record.text.text_file import PackedError, Unpacked, is_packed, open_text
from hil.units import is_convertible, scale_and_offset

_REMARKS = ("#", "%", "//", "--", "**", "EOF", "\x1a")  # what begins a line that is none of the samples
_SHOWN = 40
_FRACTIONS_S = {"ms": 1e-3, "us": 1e-6}
_LOOKED_AT = 50  # rows, for a unit behind the numbers


def columns(path: Path, found: Layout, reading: Reading = AS_IT_IS) -> tuple[list[Column], str, Layout]:
    """The columns, what had to be left out, in words, and the layout with the lines that were.

    With gaps lines that are cut off are taken as far as they go, lines of text among the samples left out; remarks,
    which a sign begins, are left out anyway.

    Raises:
        FileError: names the line and the column, and what was found there.
    """
    import pandas as pd

    table, found, odd = _rows(pd, path, found, reading)
    if not len(table):
        raise FileError(f"{path}: no rows after the header")
    notes = "; ".join(filter(None, (_left_out(path, found), odd)))
    if _may_be_cut(table, found):
        table, cut = _without_cut_line(path, found, table, reading.gaps)
        notes = "; ".join(filter(None, (notes, cut)))
    made: list[Column] = []
    for i, (heading, unit, kind) in enumerate(zip(found.headings, found.units, found.kinds, strict=True)):
        values = table[i].to_numpy()
        if kind == "stamp":
            texts = [str(text) for text in values]
            values = _stamps(path, found, i, texts)
            if short := of_two_parts(texts):
                notes = "; ".join(filter(None, (notes, f"'{heading}': stamps like {texts[0]} are taken as {short}")))
        made.append(Column(heading, values, unit))
    return _with_fractions(_with_days(made, found, table)), notes, found


def _rows(pd: Any, path: Path, found: Layout, reading: Reading) -> tuple[Any, Layout, str]:
    """The fields, the layout with the lines among them that are none, and what stood where numbers should, in words."""
    try:
        return _table(pd, path, found), found, ""
    except PackedError:
        raise
    except FileError:
        taken_out = ("",) if reading.gaps else _REMARKS
        remarks = frozenset(number for number, line in _texts(path, found) if line.startswith(taken_out))
    found = replace(found, remarks=remarks)
    if remarks:
        with suppress(FileError):
            return _table(pd, path, found), found, ""
    return _read_by_hand(pd, path, found, reading)


def _read_by_hand(pd: Any, path: Path, found: Layout, reading: Reading) -> tuple[Any, Layout, str]:
    """The same where numbers are written as pandas does not read them, or where texts stand among them."""
    table = _table(pd, path, found, by_hand=True)
    found, notes, refused = _with_marks(found, table), [], []
    for i, kind in enumerate(found.kinds):
        if kind != "number":
            continue
        texts = table[i].fillna("").astype(str).str.strip()
        unit, prefixed = _unit_behind_numbers(path, found, i, texts, reading)
        values = numbers(texts, found.decimal, found.thousands, unit, prefixed)
        filled = ~texts.isin(BLANKS).to_numpy()
        texts_among = np.flatnonzero(np.isnan(values) & filled)
        if prefixed:
            notes.append(f"'{found.headings[i]}': a letter behind a number is a power of ten, 25.1m = 0.0251")
        if texts_among.size and not (reading.gaps and 2 * texts_among.size < np.count_nonzero(filled)):
            refused.append((int(texts_among[0]), i))
        elif texts_among.size:
            at = int(texts_among[0])
            notes.append(
                f"'{found.headings[i]}' holds texts in {texts_among.size} of {len(texts)} rows, the first "
                f"'{texts.iloc[at][:_SHOWN]}' in {place(path, found, at)}; treated as missing"
            )
        table[i] = values
    if refused:
        raise FileError(f"{path}: {_no_number(path, found, *min(refused))}")
    return table, found, "; ".join(notes)


def _with_marks(found: Layout, table: Any) -> Layout:
    """The layout with the marks in all its numbers: the first that has one may stand far down."""
    cells = (text for i, kind in enumerate(found.kinds) if kind == "number" for text in table[i].dropna())
    marked = [text.strip() for text in cells if "," in text or "." in text]
    decimal, thousands = decimal_and_thousands(marked, found.separator == ",")
    return replace(found, decimal=decimal, thousands=thousands)


def _unit_behind_numbers(path: Path, found: Layout, column: int, texts: Any, reading: Reading) -> tuple[str, bool]:
    """The unit that stands behind the numbers of a column, and whether letters for powers of ten do.

    Raises:
        FileError: another unit than its heading's, or an `m`, and nothing tells if it is milli, a metre or a minute.
    """
    name, stated = headings.split(found.headings[column])
    if len(reading.columns) == len(found.headings):
        name, stated = headings.split(reading.columns[column])
    stated = reading.units.get(name) or stated or found.units[column]
    unit = next((unit for text in texts.head(_LOOKED_AT) if (unit := unit_of(text))), "")
    is_other = unit and stated and is_convertible(unit, stated) and scale_and_offset(unit, stated) != (1.0, 0.0)
    if is_other and name not in reading.units:
        raise FileError(
            f"{path}: column {column + 1} ('{name}'): its heading says '{stated}', behind its numbers stands '{unit}'; "
            f"{option('unit', f'{name}={unit}')} or {option('unit', f'{name}={stated}')} says which holds"
        )
    letters = prefixes(texts)
    if not letters:
        behind_all = unit == stated or texts[~texts.isin(BLANKS)].str.endswith(unit).all()
        return (unit if behind_all else ""), False
    if letters == {stated} or (letters, stated) == ({"m"}, "min"):
        return letters.pop(), False
    if letters == {"m"} and not stated:
        raise FileError(
            f"{path}: column {column + 1} ('{name}'): an m stands behind its numbers, milli, metre or minute; say its "
            f"unit: with {option('unit', f'{name}=A')} 25.1m is 0.0251 A, with {option('unit', f'{name}=m')} it is "
            "25.1 m"
        )
    return "", True


def _numbered(path: Path, found: Layout) -> Iterator[tuple[int, str]]:
    """Lines from the first with samples on, by their numbers."""
    with open_text(path, found.encoding) as file:
        yield from enumerate(islice(file, found.first_row - 1, None), found.first_row)


def _texts(path: Path, found: Layout) -> Iterator[tuple[int, str]]:
    """Lines among the samples without a number or a stamp in them."""
    for number, line in _numbered(path, found):
        text = line.strip()
        if text and not any(is_number(cell) or is_stamp(cell) or is_blank(cell) for cell in found.split(line)):
            yield number, text


def _left_out(path: Path, found: Layout) -> str:
    if not found.remarks:
        return ""
    number, text = next((number, text) for number, text in _texts(path, found) if number in found.remarks)
    more = f" and {len(found.remarks) - 1} more" if len(found.remarks) > 1 else ""
    return f"line {number}{more}, no row of numbers, left out: '{text[:_SHOWN]}'"


def _table(pd: Any, path: Path, found: Layout, spare: bool = False, by_hand: bool = False) -> Any:
    """The fields, column by column.

    `spare`: with one column more, for a mark at the end of each line; `by_hand`: as texts.

    Raises:
        FileError: a field is no number, or a line has too many.
    """
    kinds = {i: np.float64 if kind == "number" and not by_hand else str for i, kind in enumerate(found.kinds)}
    blanks = {i: list(BLANKS) for i, kind in enumerate(found.kinds) if kind == "number" and not by_hand}
    names = [*kinds, len(kinds)] if spare else list(kinds)
    # bytes that are no text matter to columns of text alone; a mark of the encoding stands in the first line
    only_numbers = set(found.kinds) == {"number"} and found.first_row > 1 and found.encoding == "utf-8-sig"
    encoding = "utf-8" if only_numbers else found.encoding
    thousands = None if by_hand else found.thousands or None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)  # that fields were dropped
            with Unpacked(path) if is_packed(path) else path.open("rb") as file:
                table = pd.read_csv(
                    file, sep=found.separator, decimal=found.decimal, thousands=thousands,
                    skiprows=_skipped(found), header=None, names=names, index_col=False, dtype=kinds,
                    na_values=blanks, keep_default_na=False, skipinitialspace=True, encoding=encoding,
                    encoding_errors="strict" if only_numbers else "replace", engine="c",
                )  # fmt: skip
    except pd.errors.EmptyDataError:
        raise FileError(f"{path}: no rows after the header") from None
    except pd.errors.ParserWarning:
        if not spare:
            return _table(pd, path, found, spare=True, by_hand=by_hand)
        raise FileError(f"{path}: {_explained(path, found) if by_hand else ''}") from None
    except (ValueError, pd.errors.ParserError) as error:
        raise FileError(f"{path}: {(by_hand and _explained(path, found)) or error}") from None
    if spare and (table[len(kinds)].fillna("").astype(str).str.strip() != "").any():
        raise FileError(f"{path}: {_explained(path, found) if by_hand else ''}")
    return table


def _skipped(found: Layout) -> int | list[int]:
    """What pandas leaves out: so many lines, or these, from 0."""
    before = found.first_row - 1
    return before if not found.remarks else [*range(before), *(number - 1 for number in sorted(found.remarks))]


def _lines(path: Path, found: Layout) -> Iterator[tuple[int, list[str]]]:
    """Numbers and fields of the lines with samples."""
    for number, line in _numbered(path, found):
        if line.replace(found.separator, ";").strip() and number not in found.remarks:
            yield number, found.split(line)


def _explained(path: Path, found: Layout) -> str:
    """The first line of text, or of too many fields, in words."""
    wanted = len(found.headings)
    first, text = next(_texts(path, found), (0, ""))
    for number, cells in _lines(path, found):
        if number == first:
            return _no_row(number, text)
        filled = cells[:-1] if len(cells) == wanted + 1 and not cells[-1] else cells
        if len(filled) > wanted:
            return f"line {number} {_miscounted(len(filled), found)}"
    return ""


def _no_number(path: Path, found: Layout, row: int, column: int) -> str:
    """A field that is no number, in words; the whole line where none of it is one."""
    number, cells = next(islice(_lines(path, found), row, None))
    if number == next(_texts(path, found), (0, ""))[0]:
        return _no_row(number, " ".join(cells))
    return (
        f"line {number}, column {column + 1} ('{found.headings[column]}'): '{cells[column][:_SHOWN]}' is not a number; "
        f"{option('gaps')} "
        f"takes it as a sample that was not taken, {option('columns')} can leave the column out"
    )


def _no_row(number: int, text: str) -> str:
    return f"line {number} is no row of numbers: '{text[:_SHOWN]}'; {option('gaps')} leaves such lines out"


def _miscounted(count: int, found: Layout) -> str:
    wanted = len(found.headings)
    hint = "; with decimal commas, put semicolons between the columns" if count == 2 * wanted else ""
    return f"has {count} values, the header names {wanted} columns{hint}"


def _may_be_cut(table: Any, found: Layout) -> bool:
    """Whether a row may have fewer fields than columns: its last number is missing."""
    last = len(found.headings) - 1
    if found.kinds[last] != "number":
        return False
    return bool(np.isnan(table[last].to_numpy()).any())


def _without_cut_line(path: Path, found: Layout, table: Any, gaps: bool) -> tuple[Any, str]:
    """The table without a last line that was cut off.

    Raises:
        FileError: a line has too few fields, and nothing was said about gaps.
    """
    wanted = len(found.headings)
    short = [
        (row, number, len(cells)) for row, (number, cells) in enumerate(_lines(path, found)) if len(cells) < wanted
    ]
    if not short:
        return table, ""
    row, number, count = short[0]
    if not gaps:
        raise FileError(
            f"{path}: line {number} {_miscounted(count, found)}; {option('gaps')} leaves out what is not there"
        )
    if row < len(table) - 1:
        return table, ""
    return table.iloc[:-1], f"line {number}, the last, is cut off ({count} of {wanted} values) and left out"


def _stamps(path: Path, found: Layout, column: int, texts: list[str]) -> Any:
    with suppress(ValueError, OverflowError):
        return stamps(texts)
    number, text = next(
        ((number, text) for (number, _), text in zip(_lines(path, found), texts, strict=False) if not _is_read(text)),
        (found.first_row, texts[0]),
    )
    raise FileError(
        f"{path}: line {number}, column {column + 1} ('{found.headings[column]}'): '{text}' is no date or time of the "
        f"day; {option('interval', 'S')} reads evenly spaced samples without it"
    )


def _is_read(stamp: str) -> bool:
    with suppress(ValueError, OverflowError):
        return len(stamps([stamp])) > 0
    return False


def _with_days(columns: list[Column], found: Layout, table: Any) -> list[Column]:
    """A column of days and one of times of the day as one column of stamps."""
    dated = [i for i, kind in enumerate(found.kinds) if kind == "stamp"]
    days = [i for i in dated if len(table) and is_date_only(str(table[i].iloc[0]))]
    clocks = [i for i in dated if columns[i].values.dtype.kind == "m"]
    days = [i for i in days if i not in clocks]  # 10.11.12 may be a clock
    if not (days and clocks):
        return [c for i, c in enumerate(columns) if i not in days] if len(days) < len(dated) else columns
    day, clock = days[0], clocks[0]
    both = replace(columns[clock], values=joined(columns[day].values, columns[clock].values))
    return [both if i == clock else column for i, column in enumerate(columns) if i not in days]


def _with_fractions(columns: list[Column]) -> list[Column]:
    """A clock of whole seconds and the column of milliseconds beside it as one column of stamps."""
    for clock, parts in pairwise(columns):
        if (fine := _seconds_with_fraction(clock, parts)) is not None:
            return [fine if c is clock else c for c in columns if c is not parts]
        size_ns = headings.fraction_ns(parts.name_and_unit[0])
        if not (clock.is_dated and size_ns and parts.is_number):
            continue
        whole = clock.values == clock.values.astype(f"{clock.values.dtype.kind}8[s]")
        if whole.all() and np.all((parts.values >= 0) & (parts.values * size_ns < 1e9)):
            fine = clock.values + (parts.values * size_ns).astype("m8[ns]")
            return [replace(c, values=fine) if c is clock else c for c in columns if c is not parts]
    return columns


def _seconds_with_fraction(clock: Column, parts: Column) -> Column | None:
    """Two columns of numbers, whole seconds and their milliseconds, as one time; None where they are none."""
    if _time_unit(clock) != "s" or (size_s := _FRACTIONS_S.get(_time_unit(parts))) is None:
        return None
    if not (clock.is_number and parts.is_number and np.all((parts.values >= 0) & (parts.values * size_s < 1.0))):
        return None
    time_s = np.round(clock.values + parts.values * size_s, 6)
    repeats = bool(np.any(np.diff(clock.values) == 0.0) and np.all(clock.values % 1.0 == 0.0))
    if not repeats or np.any(np.diff(time_s) <= 0.0):
        return None
    return replace(clock, heading=clock.heading if clock.is_time else "time [s]", values=time_s)


def _time_unit(column: Column) -> str:
    """The unit of a column of times, as it states it or as its name does; empty for any other."""
    name, unit = column.name_and_unit
    return headings.spelt_time_unit(unit) if unit else headings.time_unit(name)


def place(path: Path, found: Layout, row: int) -> str:
    """Where a row of samples stands."""
    number = next((number for i, (number, _) in enumerate(_lines(path, found)) if i == row), 0)
    return f"line {number}" if number else f"sample {row}"
