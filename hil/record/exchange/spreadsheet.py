"""Spreadsheets of Excel and LibreOffice, read only: the sheet with the most numbers, as if it were a text file."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO

import numpy as np

from hil.errors import FileError
from hil.language.note import Note
from hil.record.exchange import csv as text_table
from hil.record.extra import library
from hil.record.reading import Reading
from hil.record.recording import Recording
from hil.record.table.columns import Column, Contents, Table
from hil.record.table.response_table import ResponseTable
from hil.record.table.tokens import is_number

SUFFIXES = (".xlsx", ".xlsm", ".xlsb", ".xls", ".ods")
KIND = "a spreadsheet"
LIBRARIES = ("python_calamine", "openpyxl", "encodings.cp437")  # in which a zip file keeps its names
OR_TEXT = True


def contents(path: Path, file: BinaryIO) -> Contents:
    """A sheet of an open file, as the bytes of a text file with one line for each row.

    Raises:
        FileError: no sheet has rows.
    """
    book = library("python_calamine", path).CalamineWorkbook.from_filelike(file)
    sheets = {name: book.get_sheet_by_name(name) for name in book.sheet_names}
    filled = {name: list(sheet.iter_rows()) for name, sheet in sheets.items() if sheet.width and sheet.height}
    if not filled:
        raise FileError(f"{path}: no sheet holds anything")
    name = max(filled, key=lambda one: (sum(_is_value(cell) for row in filled[one] for cell in row), len(filled[one])))
    percent = _shown_in_percent(path, file, name, sheets[name].start, filled[name])
    text = io.StringIO()
    text.write("\n" * sheets[name].start[0])  # so that a line's number is that of the row
    rows = csv.writer(text, delimiter="\t", lineterminator="\n")
    rows.writerows([_text(cell, k in percent) for k, cell in enumerate(row)] for row in filled[name])
    others = tuple(other for other in filled if other != name)
    left_out = Note(
        "sheet '{sheet}' is read, which has the most numbers; not read: {others}", sheet=name, others=others
    )
    column = Column(name, np.frombuffer(text.getvalue().encode(), dtype=np.uint8))
    return [Table(name, [column], assumed=left_out if others else "")], ""


def assembled(path: Path, found: Contents, reading: Reading) -> Recording | ResponseTable:
    """The recording in such lines.

    Raises:
        FileError: as of a text file; a line is a row.
    """
    ((table,), _) = found
    with TemporaryDirectory() as folder:
        lines = Path(folder) / f"{path.stem}.tsv"
        lines.write_bytes(table.columns[0].values.tobytes())
        try:
            read = text_table.read(lines, reading)
        except FileError as error:
            raise FileError(str(error).replace(str(lines), f"{path}, sheet '{table.name}'")) from None
    notes = [table.assumed] if table.assumed else []
    if not isinstance(read, Recording):
        return replace(read, name=str(path))
    return replace(read, name=str(path), meta={**read.meta, "assumed": [*notes, *read.meta.get("assumed", ())]})


def _is_value(cell: Any) -> bool:
    return not isinstance(cell, str) or is_number(cell)


def _shown_in_percent(
    path: Path, file: BinaryIO, sheet: str, start: tuple[int, int], rows: Sequence[Sequence[Any]]
) -> frozenset[int]:
    """Columns in % whose numbers are formatted so: 0.5 is kept where the sheet shows 50 %."""
    headed = {k for row in rows for k, cell in enumerate(row) if isinstance(cell, str) and "%" in cell}
    if not headed or path.suffix.lower() not in (".xlsx", ".xlsm"):  # of the others no library gives formats
        return frozenset()
    fullest = max(range(len(rows)), key=lambda at: sum(not isinstance(cell, str) for cell in rows[at]))
    file.seek(0)
    cells = library("openpyxl", path).load_workbook(file, read_only=True)[sheet]
    at = start[0] + fullest + 1
    (row,) = cells.iter_rows(min_row=at, max_row=at, min_col=start[1] + 1, max_col=start[1] + len(rows[fullest]))
    return frozenset(k for k, cell in enumerate(row) if k in headed and "%" in str(cell.number_format))


def _text(cell: Any, in_percent: bool) -> str:
    if isinstance(cell, bool):
        return str(int(cell))
    if in_percent and isinstance(cell, int | float):
        return str(Decimal(str(cell)).scaleb(2))
    return " ".join(str(cell).split())
