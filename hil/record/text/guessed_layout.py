"""The layout of a text file that nobody described, guessed from its lines."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from hil.errors import FileError, option
from hil.record.table import heading as headings
from hil.record.table.tokens import (
    as_numbers,
    decimal_and_thousands,
    is_blank,
    is_date_only,
    is_number,
    is_quantity,
    is_stamp,
    prefix_of,
    unit_of,
)
from hil.record.text.header_metadata import units_above
from hil.record.text.layout import WHITESPACE, Kind, Layout, is_row_of_units, is_unit, split, stands_for_unit
from hil.record.text.text_file import Beginning

_SEPARATORS = ("\t", ";", ",", "|", WHITESPACE)
_JUDGED = 60
_LEAST_NUMERIC = 0.2
_NAME_LABELS = frozenset({"tagname", "tag", "name", "names", "channel", "channels", "signal", "signals", "variable"})
_ALSO_UNITS = ("", "K", "T")  # of the letters for powers of ten: kelvin and tesla where every number has one
_RULE = re.compile(r"[\s|+:=_-]*(--|==|__)[\s|+:=_-]*")  # below the headings of a printed table
_TYPES = frozenset({"float", "double", "single", "int", "integer", "real", "float64", "float32", "number", "f8"})


def layout(begun: Beginning, named: bool = False) -> Layout:
    """The layout of a file; `named`: its columns get names, whatever its headings say.

    Raises:
        FileError: no rows of numbers, or headings that do not belong to them; says what helps.
    """
    found = _as_contract(begun.encoding, begun.lines) if not named else None
    return found or _guessed(begun, named)


def _as_contract(encoding: str, lines: Sequence[str]) -> Layout | None:
    """The layout of a file whose first line is `name [unit]` in every column: nothing is guessed about it."""
    hinted = bool(lines) and lines[0].lower().lstrip('"').startswith("sep=")
    at = 1 if hinted else 0
    if len(lines) <= at:
        return None
    for mark in ",;\t":
        cells = split(lines[at].lstrip("#% "), mark)
        while len(cells) > 1 and not cells[-1]:
            cells.pop()
        if len(cells) > 1 and all(cell.count("[") == 1 and cell.endswith("]") for cell in cells):
            rows = [split(line, mark) for line in lines[at + 1 :] if line.strip()]
            kinds = tuple(_kind([row[i] for row in rows if len(row) > i]) for i in range(len(cells)))
            decimal, thousands = decimal_and_thousands([cell for row in rows for cell in row], mark == ",")
            units = ("",) * len(cells)
            return Layout(encoding, mark, decimal, thousands, tuple(cells), units, at + 2, kinds)
    return None


def _guessed(begun: Beginning, named: bool) -> Layout:
    path, lines = begun.path, begun.lines
    filled = [line for line in lines if line.strip() and not line.lstrip().startswith(("#", "%"))]
    judged = filled[-_JUDGED:]
    separator, count = _separator(judged)
    rows = [split(line, separator) for line in judged]
    if count > 1 and not any(row[count - 1] for line in filled if len(row := split(line, separator)) == count):
        count -= 1  # a mark at the end of each line
    rows = [row for row in rows if 2 * sum(map(_is_known, row)) >= len(row)] or rows  # prose with a number is no row
    whole = [row for row in (split(line, separator) for line in filled) if len(row) >= count]
    kinds = tuple(_kind([row[i] for row in rows if len(row) >= count], [row[i] for row in whole]) for i in range(count))
    first = _first_row(lines, separator, count, kinds)
    if first is None:
        raise FileError(f"{path}: {_no_rows(filled, begun.is_whole)}")
    before = split(lines[first - 1], separator) if first else []
    if len(before) > count and all(map(_is_known, before)):
        raise FileError(f"{path}: line {first} has {len(before)} values, those below {count}; each needs as many")
    rows = [split(line, separator) for line in lines[first:] if line.strip()]
    decimal, thousands = decimal_and_thousands([cell for row in rows for cell in row], separator == ",")
    above = list(_heading_rows(lines[:first], separator, count))
    at, cells, units = (0, ("",) * count, ("",) * count) if named else _headings(above, count)
    if not at and not named:
        raise FileError(
            f"{path}: {_unnamed(lines[:first], separator, count - _days_apart(rows[0], kinds), _rise(rows))}"
        )
    if at and not any(units) and not any(headings.split(cell)[1] for cell in cells):
        units = units_above(lines[: at - 1], separator, cells)
    inside = [_unit_in_cells([row[i] for row in rows if len(row) > i and not is_blank(row[i])]) for i in range(count)]
    inside = ["" if headings.split(cell)[1] else found for cell, found in zip(cells, inside, strict=True)]
    units = tuple(unit or found for unit, found in zip(units, inside, strict=True))
    return Layout(begun.encoding, separator, decimal, thousands, cells, units, first + 1, kinds)


def _days_apart(cells: Sequence[str], kinds: Sequence[Kind]) -> int:
    """How many columns hold days beside one of times of the day: these are read as one."""
    dated = [cell for cell, kind in zip(cells, kinds, strict=False) if kind == "stamp"]
    days = sum(map(is_date_only, dated))
    return days if days < len(dated) else 0


def _separator(lines: Sequence[str]) -> tuple[str, int]:
    """The mark that leaves the most fields numbers or stamps, and the number of fields of lines that hold the most."""
    best, score = (",", 1), -1.0
    for mark in _SEPARATORS:
        rows = [split(line, mark) for line in lines]
        weights: Counter[int] = Counter()
        for row in rows:
            texts = sum(not _is_known(cell) for cell in row)
            weights[len(row)] += 1 + len(rows) * max(0, sum(map(_is_quantity_or_stamp, row)) - texts)
        count = weights.most_common(1)[0][0] if rows else 0
        quantities = [sum(map(_is_quantity_or_stamp, row)) for row in rows]
        like_samples = [
            row for row, n in zip(rows, quantities, strict=True) if 2 * n > len(row) or (n and len(row) == count)
        ]
        known = sum(_is_known(cell) for row in like_samples for cell in row if len(row) == count)
        share = known / (count * len(like_samples)) if like_samples else 0.0
        if count > 1 and share > score + 1e-9 and share >= _LEAST_NUMERIC:
            best, score = (mark, count), share
    return best


def _is_quantity_or_stamp(cell: str) -> bool:
    return is_quantity(cell) or is_stamp(cell)


def _is_known(cell: str) -> bool:
    return is_blank(cell) or _is_quantity_or_stamp(cell)


def _kind(cells: Sequence[str], others: Sequence[str] = ()) -> Kind:
    """What a column holds; `others` are looked at where all these cells are blank."""
    filled = [cell for cell in cells if not is_blank(cell)] or [cell for cell in others if not is_blank(cell)]
    numbers = sum(is_number(cell) or prefix_of(cell) != "" for cell in filled)
    dates = sum(map(is_stamp, filled))
    if 2 * numbers >= len(filled) or _unit_in_cells(filled):
        return "number"
    return "stamp" if 2 * dates >= len(filled) else "text"


def _unit_in_cells(filled: Sequence[str]) -> str:
    """The unit that stands behind every number of a column; empty where there is none, or it may be a power of ten."""
    units = {unit_of(cell) if prefix_of(cell) in _ALSO_UNITS else "" for cell in filled}
    return units.pop() if len(units) == 1 else ""


def _first_row(lines: Sequence[str], separator: str, count: int, kinds: Sequence[Kind]) -> int | None:
    """The first line whose cells are what the columns hold, or of those before it with one that is not."""

    def fits(line: str) -> list[bool]:
        cells = split(line, separator)
        if len(cells) == count + 1 and not cells[-1]:
            cells.pop()
        if len(cells) != count or not any(map(_is_quantity_or_stamp, cells)):
            return [False]
        pairs = zip(cells, kinds, strict=True)
        return [
            is_blank(c) or (is_quantity(c) if kind == "number" else is_stamp(c))
            for c, kind in pairs if kind != "text"
        ]  # fmt: skip

    first = next((i for i, line in enumerate(lines) if line.strip() and all(fits(line))), None)
    while first and (before := fits(lines[first - 1]))[0] and 2 * sum(before) > len(before):
        first -= 1
    return first


def _heading_rows(lines: Sequence[str], separator: str, count: int) -> Iterator[tuple[int, list[str]]]:
    """Numbers and cells of the lines above the rows that have a cell for each column."""
    for number, line in enumerate(lines, 1):
        bare = line.lstrip("#% ")
        raw = () if separator == WHITESPACE and line.startswith("%") else (line,)
        for text in (bare, *raw) if bare.strip(separator) and not _RULE.fullmatch(line) else ():
            cells = _heading_cells(text, separator, count)
            if len(cells) == count and any(cells):
                yield number, cells
                break


def _heading_cells(text: str, separator: str, count: int) -> list[str]:
    if separator != WHITESPACE:
        cells = split(text, separator)
        return cells if len(cells) != count + 1 or cells[-1] else cells[:-1]
    tries = (
        re.findall(r'"([^"]+)"', text), re.split(r"\t|\s{2,}", text.strip()),
        re.split(r"\s+(?![\[(])", text.strip()), text.split(),
    )  # fmt: skip
    fitting = (cells for cells in tries if len(cells) == count and not any(c.count('"') % 2 for c in cells))
    return next((cells for cells in fitting if not _is_prose(cells)), [])


def _is_prose(cells: Sequence[str]) -> bool:
    """Whether words are a sentence, or say something of the file: `# type: matrix`, `title = u,y`."""
    labels = [cell in ("=", "#") or cell.endswith(":") for cell in cells]
    return any(is_number(cell.strip("()[]")) for cell in cells) or (any(labels) and not all(labels))


def _headings(above: list[tuple[int, list[str]]], count: int) -> tuple[int, tuple[str, ...], tuple[str, ...]]:
    """Line, headings and units; line 0 where there are none."""
    texts = [(number, cells) for number, cells in above if not all(is_number(c) or is_blank(c) for c in cells)]
    texts = [(number, cells) for number, cells in texts if not all(c.casefold() in _TYPES or not c for c in cells)]
    if not texts:
        return 0, ("",) * count, ("",) * count
    called = [i for i, (_, cells) in enumerate(texts) if _is_heading(cells)]
    chosen = next((i for i in reversed(called) if not is_row_of_units(texts[i][1])), called[0] if called else None)
    if chosen is None:
        plain = [i for i, (_, cells) in enumerate(texts) if i == 0 or not is_row_of_units(cells)]
        chosen = plain[-1]
    number, cells = texts[chosen]
    others = [*texts[chosen + 1 :], *texts[:chosen]]
    units = next((found for _, found in others if is_row_of_units(found)), [""] * count)
    known = [is_unit(unit) or headings.is_counter(unit) for unit in units]
    bare = [
        headings.unit_text(unit) if k and not stands_for_unit(unit) else ""
        for k, unit in zip(known, units, strict=True)
    ]
    return number, tuple(cells), tuple(bare)


def _is_heading(cells: Sequence[str]) -> bool:
    names = [headings.split(cell)[0] for cell in cells]
    timed = any(headings.is_time(name) or headings.is_date(name) for name in names) and not any(map(is_stamp, cells))
    labelled = cells[0].casefold() in _NAME_LABELS
    return timed or labelled or sum("[" in cell for cell in cells) * 2 > len(cells)


def _no_rows(filled: Sequence[str], is_whole: bool) -> str:
    if len(filled) <= 1 and is_whole:
        return "no rows after the header"
    return (
        "no rows of numbers were found; each row holds one number per column, separated by commas, semicolons, tabs or "
        "blanks"
    )


def _rise(rows: Sequence[Sequence[str]]) -> bool:
    """Whether the first column rises from row to row, as a time does."""
    values = as_numbers([row[0] for row in rows if row])
    return len(values) > 2 and bool(np.all(np.diff(values) > 0.0))


def _unnamed(above: Sequence[str], separator: str, count: int, rises: bool) -> str:
    timed = count > 2 or (count == 2 and rises)
    named = ["time", "command", "flow"] if count > 2 else ["time", "flow"] if timed else ["command", "flow"]
    example = ",".join([*named[:count], *["-"] * min(count - 3, 5), *["…"] * (count > 8)])
    even = "" if timed else f", and {option('interval', 'S')} for the seconds between samples"
    asked = f"name the {count} columns with {option('columns')}, as in {option('columns', f'{example}')}{even}"
    filled = [(i, line) for i, line in enumerate(above, 1) if line.strip()]
    if not filled:
        return f"the columns have no headings; {asked}"
    number, line = filled[-1]
    cells = len(split(line, separator))
    hint = "; with decimal commas, put semicolons between the columns" if count == 2 * cells else ""
    return (
        f"line {number + 1} has {count} values, the header names {cells} columns in line {number}{hint}. If that line "
        f"is no header, {asked}"
    )
