"""How many rows of a run folder are really there, and whether they are what was written."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hil.record.samples import ROWS_FILE, VALUE_BYTES, Mark, marks
from hil.untrusted import ANY_SIZE, open_untrusted

_PIECE_BYTES = 1 << 20


@dataclass(frozen=True, slots=True)
class Scan:
    """What a look at rows found: how many are there with which checksum, and whether they are in order.

    `clean`: every value is finite and time increases from row to row.
    """

    mark: Mark
    clean: bool


def scan(folder: Path, columns: int, rows: int) -> Scan:
    """Look at the first `rows` rows once, in pieces that fit any memory; fewer when the file ends before."""
    row_bytes = columns * VALUE_BYTES
    chunk_rows = max(1, _PIECE_BYTES // row_bytes)
    mark, clean, last_s = Mark(), True, -np.inf
    with open_untrusted(folder, ROWS_FILE, ANY_SIZE) as file:
        while mark.rows < rows:
            data = file.read(min(chunk_rows, rows - mark.rows) * row_bytes)
            table = np.frombuffer(data, "<f8", len(data) // row_bytes * columns).reshape(-1, columns)
            if not len(table):
                break
            clean = clean and bool(np.isfinite(table).all() and (np.diff(table[:, 0], prepend=last_s) > 0).all())
            last_s = float(table[-1, 0])
            mark = mark.after(memoryview(data)[: table.nbytes], len(table))
    return Scan(mark, clean)


def last_good(folder: Path, columns: int) -> Mark:
    """The last mark of the journal up to which every block is what was written."""
    good = Mark()
    with open_untrusted(folder, ROWS_FILE, ANY_SIZE) as file:
        for mark in marks(folder):
            rows = mark.rows - good.rows
            data = file.read(rows * columns * VALUE_BYTES)
            if rows <= 0 or good.after(memoryview(data), rows) != mark:
                break
            good = mark
    return good
