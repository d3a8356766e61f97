"""CSV, the contract's format: header `name [unit]`, `time [s]` first, one row per sample; `.csv.gz` too.

Also read: what loggers, spreadsheets and terminals write as text. Semicolons, tabs or blanks between columns, decimal
commas, lines before the headings, units in brackets, behind a comma or in a row of their own, stamps of a calendar or
a clock, time in any column, several columns of time, text beside the numbers.
"""

from __future__ import annotations

import csv
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from hil.errors import FileError
from hil.language.note import Note
from hil.record.reading import AS_IT_IS, Reading
from hil.record.recording import Recording, sample
from hil.record.table.assemble import assemble
from hil.record.table.columns import Table
from hil.record.table.response_table import ResponseTable
from hil.record.text.guessed_layout import layout
from hil.record.text.header_metadata import of_header_lines
from hil.record.text.layout import Layout
from hil.record.text.text_file import beginning_of, open_text
from hil.record.text.text_rows import columns, place
from hil.record.text.vendor_formats import in_vendor_format

_ENDINGS = (".csv", ".txt", ".dat", ".tsv", ".asc", ".prn", ".log")
SUFFIXES = (*_ENDINGS, *(f"{ending}.gz" for ending in _ENDINGS))
_CHUNK_ROWS = 10_000
_OTHER_LETTERS = re.compile(r"[^\x00-\x7f]{3}")


def read(path: Path, reading: Reading = AS_IT_IS) -> Recording | ResponseTable:
    """Read a recording.

    A first column `sample [1]` stands for an even time base that the file does not state; one second per
    sample is taken and `meta["assumed"]` says so.

    Raises:
        FileError: names the file, the line and the column, what was found there, and what helps.
    """
    try:
        begun = beginning_of(path)
        known = None if reading.columns else in_vendor_format(begun) or of_header_lines(begun)
        found = layout(begun, named=bool(reading.columns)) if known is None else known.layout
        read_columns, note, found = columns(path, found, reading)
        note = "; ".join(filter(None, (note, _illegible(found, reading))))
        tables = [Table(path.stem, read_columns)] if known is None else known.tables(read_columns)
        tables = [replace(one, assumed="; ".join(filter(None, (one.assumed, note)))) for one in tables]
        return assemble(str(path), tables, None, reading, partial(place, path, found) if len(tables) == 1 else sample)
    except (OSError, EOFError, UnicodeError, csv.Error) as error:
        raise FileError(f"{path}: cannot be read as CSV: {error}") from error


def _illegible(found: Layout, reading: Reading) -> str:
    """What is said of headings in another encoding: no western language has three such letters in a row."""
    if reading.columns or found.encoding != "cp1252" or not _OTHER_LETTERS.search(" ".join(found.headings)):
        return ""
    return Note("the headings are neither UTF-8 nor Western European; save it as UTF-8, or say names with --columns")


def write(recording: Recording, path: Path) -> None:
    """Write a recording; every number in the fewest digits that give it back exactly.

    Where a channel has no sample the field is empty.
    """
    values = [recording.time_s, *(channel.values for channel in recording.channels.values())]
    with open_text(path, "utf-8", "wt") as file:
        headings = ["time [s]", *(channel.heading for channel in recording.channels.values())]
        csv.writer(file, lineterminator="\n").writerow(headings)
        blanks = any(np.isnan(column).any() for column in values)
        for start in range(0, len(recording), _CHUNK_ROWS):
            rows = np.stack([column[start : start + _CHUNK_ROWS] for column in values], axis=1).tolist()
            lines = (",".join(map(repr, row)) + "\n" for row in rows)
            file.writelines((line.replace("nan", "") for line in lines) if blanks else lines)
