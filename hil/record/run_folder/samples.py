"""Rows of samples on disk, and the journal that says how many of them are whole.

`samples.f8` holds rows of little-endian float64. `samples.log` gets one line of 25 bytes for each block: how
many rows there are now, and the CRC-32 of all of them. A line is written after its rows, so what the last
whole line says is there; after a power cut, which may bring any part of either file to the disk, the checksum
tells how far it really goes.
"""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from io import SEEK_END, BufferedReader, FileIO
from pathlib import Path

import numpy as np

from hil.errors import FileError
from hil.record.durable import copy_open, is_at, is_deleted, place_of, write_at
from hil.record.recording import Array
from hil.untrusted import ANY_SIZE, UNASKED_BYTES, open_untrusted

ROWS_FILE, JOURNAL_FILE = "samples.f8", "samples.log"
LINE_BYTES = 25
VALUE_BYTES = 8
_PIECE_BYTES = 1 << 20
COPIED_BYTES = 1 << 28
"""Up to this size samples are copied into memory, each channel in one piece; beyond, they stay on the disk."""
_PIECE_ROWS = 1 << 16
UNREADABLE = "cannot be read from line {} on"
_OPEN = "the run was not closed: it is still being written, or its program was killed"


@dataclass(frozen=True, slots=True)
class Mark:
    """A number of rows and the CRC-32 of all of them."""

    rows: int = 0
    crc32: int = 0

    def line(self) -> bytes:
        """As it stands in the journal."""
        return b"%15d %08x\n" % (self.rows, self.crc32)

    def after(self, block: memoryview, rows: int) -> Mark:
        """The mark when a block of rows has been added."""
        return Mark(self.rows + rows, zlib.crc32(block, self.crc32))


class RowsWriter:
    """Appends rows; every file position follows from what is known to be whole, never from the last write.

    So a write that fails or is interrupted half way leaves nothing behind that a later one would not replace.

    Attributes:
        mark: the rows that are whole.
        last_s: stamp of the last of them, None before the first.
    """

    def __init__(self, folder: Path, columns: int) -> None:
        self._row_bytes = columns * VALUE_BYTES
        self._path = folder / ROWS_FILE
        self._file = FileIO(self._path, "r+")
        self._journal = FileIO(folder / JOURNAL_FILE, "r+")
        self._named = not is_deleted(self._file) and is_at(self._file, self._path)  # some file systems say so of none
        self._lines = 0
        self._sums = {ROWS_FILE: hashlib.sha256(), JOURNAL_FILE: hashlib.sha256()}
        self.mark = Mark()
        self.last_s: float | None = None

    @property
    def is_away(self) -> bool:
        """Whether the folder was deleted or moved under them."""
        return self._named and not is_at(self._file, self._path)

    @property
    def is_deleted(self) -> bool:
        """Whether the folder was deleted under them."""
        return self._named and is_deleted(self._file)

    @property
    def folder(self) -> Path | None:
        """Where they lie now, where the system tells."""
        place = place_of(self._file)
        return None if place is None else place.parent

    def copy_to(self, folder: Path) -> None:
        """Write what is whole into the files of another folder; raises `OSError`."""
        self.trim()
        copy_open(self._file, folder / ROWS_FILE)
        copy_open(self._journal, folder / JOURNAL_FILE)

    @property
    def sha256(self) -> dict[str, str]:
        """Of what is whole in each file."""
        return {name: found.hexdigest() for name, found in self._sums.items()}

    @property
    def descriptors(self) -> tuple[int, int]:
        """Of the rows and of the journal."""
        return self._file.fileno(), self._journal.fileno()

    def append(self, table: Array) -> None:
        """Add rows, shape (n, columns), little-endian and row by row.

        Raises:
            OSError: they could not be written; the files end with the last whole row.
        """
        block = table.data.cast("B")
        before = self.mark, self.last_s
        try:
            write_at(self._file, self.mark.rows * self._row_bytes, block)
            self.mark, self.last_s = self.mark.after(block, len(table)), float(table[-1, 0])
            write_at(self._journal, self._lines * LINE_BYTES, self.mark.line())
            self._lines += 1
            self._sums[ROWS_FILE].update(block)
            self._sums[JOURNAL_FILE].update(self.mark.line())
        except OSError:
            self.mark, self.last_s = before
            self.trim()
            raise

    def trim(self) -> None:
        """Cut off what does not belong to a whole row or line."""
        self._file.truncate(self.mark.rows * self._row_bytes)
        self._journal.truncate(self._lines * LINE_BYTES)

    def close(self) -> None:
        """Let go of the files."""
        self._file.close()
        self._journal.close()


def marks(folder: Path) -> Iterator[Mark]:
    """The lines of the journal, up to the first that is not whole."""
    with open_untrusted(folder, JOURNAL_FILE, UNASKED_BYTES) as file:
        while (mark := _parsed(file.read(LINE_BYTES))) is not None:
            yield mark


def last_mark(folder: Path) -> tuple[Mark, int | None]:
    """What the last whole line of the journal says, no rows when there is none; and the first after it that is none."""
    with open_untrusted(folder, JOURNAL_FILE, UNASKED_BYTES) as file:
        lines = file.seek(0, SEEK_END) // LINE_BYTES
        for line in reversed(range(lines)):
            file.seek(line * LINE_BYTES)
            if (mark := _parsed(file.read(LINE_BYTES))) is not None:
                return mark, None if line == lines - 1 else line + 2
    return Mark(), 1 if lines else None


def _parsed(line: bytes) -> Mark | None:
    try:
        mark = Mark(int(line[:15]), int(line[16:24], 16))
    except ValueError:
        return None
    return mark if mark.line() == line else None


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """The rows of a run folder that are what was written.

    Attributes:
        table: shape (columns, rows); of a large run a read-only view of the file.
        clean: whether they pass every check: finite values, and time that increases from row to row.
        missing: what is missing after them, in words.
    """

    table: Array
    clean: bool
    missing: str = ""


def read_rows(folder: Path, columns: int, closed: Mark | None) -> Rows:
    """The rows of a run, as far as they are what was written.

    Args:
        folder: of the run.
        columns: of a row.
        closed: what the end of the run says of them; None where the run was not closed and its journal says it.

    Raises:
        FileError: a file cannot be read, or was changed after the run was closed.
    """
    try:
        claimed, bad_line = last_mark(folder) if closed is None else (closed, None)
        with open_untrusted(folder, ROWS_FILE, ANY_SIZE) as file:
            found, clean = _scan(file, columns, claimed.rows)
            if found == claimed:
                missing = _OPEN if closed is None else ""
                if bad_line is not None:
                    missing += f"; {JOURNAL_FILE} {UNREADABLE.format(bad_line)}: samples after {found.rows} are lost"
                return Rows(_table(file, columns, found.rows), clean and found.rows > 1, missing)
            good = _last_good(file, columns, marks(folder))
            if closed is not None and found.rows == closed.rows:
                raise FileError(
                    f"{folder / ROWS_FILE}: changed after the run was closed, from row {good.rows} on: CRC-32 "
                    f"{found.crc32:08x}, expected {closed.crc32:08x} over {closed.rows} rows"
                )
            clean = _scan(file, columns, good.rows)[1] and good.rows > 1
            missing = f"of {claimed.rows} rows only the first {good.rows} are in {ROWS_FILE}"
            return Rows(_table(file, columns, good.rows), clean, missing)
    except OSError as error:
        raise FileError(f"{error.filename}: cannot be read: {error.strerror}; a run folder needs it") from None


def _scan(file: BufferedReader, columns: int, rows: int) -> tuple[Mark, bool]:
    """How many of the first `rows` rows are there, with which checksum, and whether they are finite and in order.

    They are looked at once, in pieces that fit any memory.
    """
    row_bytes = columns * VALUE_BYTES
    chunk_rows = max(1, _PIECE_BYTES // row_bytes)
    mark, clean, last_s = Mark(), True, -np.inf
    file.seek(0)
    while mark.rows < rows:
        data = file.read(min(chunk_rows, rows - mark.rows) * row_bytes)
        table = np.frombuffer(data, "<f8", len(data) // row_bytes * columns).reshape(-1, columns)
        if not len(table):
            break
        clean = clean and bool(np.isfinite(table).all() and (np.diff(table[:, 0], prepend=last_s) > 0).all())
        last_s = float(table[-1, 0])
        mark = mark.after(memoryview(data)[: table.nbytes], len(table))
    return mark, clean


def _last_good(file: BufferedReader, columns: int, journal: Iterable[Mark]) -> Mark:
    """The last mark of the journal up to which every block is what was written."""
    good = Mark()
    file.seek(0)
    for mark in journal:
        rows = mark.rows - good.rows
        data = file.read(rows * columns * VALUE_BYTES)
        if rows <= 0 or good.after(memoryview(data), rows) != mark:
            break
        good = mark
    return good


def _table(file: BufferedReader, columns: int, rows: int) -> Array:
    if rows * columns * VALUE_BYTES > COPIED_BYTES:
        return np.asarray(np.memmap(file, "<f8", "r", shape=(rows, columns))).T
    table = np.empty((columns, rows))
    file.seek(0)
    for first in range(0, rows, _PIECE_ROWS):  # the whole of it twice in memory costs more than to read it
        piece = table[:, first : first + _PIECE_ROWS]
        piece.T[:] = np.fromfile(file, "<f8", piece.size).reshape(-1, columns)
    return table
