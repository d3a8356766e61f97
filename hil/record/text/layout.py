"""How a text file is laid out: encoding, separator, decimal mark, the lines of headings and units, the first row."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from hil.record.table import heading as headings

WHITESPACE = r"\s+"
_UNIT_LABELS = frozenset({"unit", "units", "einheit", "einheiten", "eu", "unité"})
_MOST_WORDS = 3  # of a unit
_TOA5 = ("TS", "RN")  # what stands for units of the stamp and of the record's number

Kind = Literal["number", "stamp", "text"]


@dataclass(frozen=True, slots=True)
class Layout:
    """How a text file is laid out.

    Attributes:
        separator: between fields, or `WHITESPACE`.
        headings, units: of the columns, empty texts where none are stated.
        first_row: number of the first line with samples.
        kinds: of the columns.
        remarks: numbers of lines among the samples that are left out.
    """

    encoding: str
    separator: str
    decimal: str
    thousands: str
    headings: tuple[str, ...]
    units: tuple[str, ...]
    first_row: int
    kinds: tuple[Kind, ...]
    remarks: frozenset[int] = frozenset()

    def split(self, line: str) -> list[str]:
        """The fields of a line."""
        return split(line, self.separator)


def split(line: str, separator: str) -> list[str]:
    """The fields of a line, without the blanks around them."""
    if separator == WHITESPACE:
        return line.split()
    return [
        field.strip()
        for field in next(csv.reader([line.strip("\r\n")], delimiter=separator, skipinitialspace=True), [])
    ]


def is_row_of_units(cells: Sequence[str]) -> bool:
    """Whether most cells of a line above the samples are units, but for those of the time and of the row's number."""
    if cells[0].casefold() in _UNIT_LABELS or tuple(cells[:2]) == _TOA5:
        return True
    filled = [
        cell for cell in cells if not (headings.is_time(cell) or headings.is_counter(cell) or is_time_format(cell))
    ]
    is_sentence = any(len(cell.split()) > _MOST_WORDS for cell in cells)
    return not is_sentence and 2 * sum(map(is_unit, filled)) > len(filled)


def is_unit(cell: str) -> bool:
    """Whether a cell of a row of units is one."""
    bare = headings.unit_text(cell)
    return bare == "1" or headings.is_unit(bare) or headings.is_time_unit(bare)


def stands_for_unit(text: str) -> bool:
    """Whether a cell of a row of units only labels that row, or says that its column has none."""
    return text.casefold() in _UNIT_LABELS or text in _TOA5


def is_time_format(text: str) -> bool:
    """Whether a text describes stamps, as `hh:mm:ss` does."""
    return bool(
        re.fullmatch(r"[\[(]?(y+|d+|m+|h+|s+|f+)([\W_T]+(y+|d+|m+|h+|s+|f+))+[\])]?", text.strip(), re.IGNORECASE)
    )
