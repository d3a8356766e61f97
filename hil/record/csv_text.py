"""A table as CSV."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from io import StringIO
from pathlib import Path

from hil.errors import storing
from hil.record.durable import write_named


def csv_text(heads: Iterable[str], rows: Iterable[Sequence[object]]) -> str:
    """A table as CSV text: one line of heads, then the rows."""
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(heads)
    writer.writerows(rows)
    return text.getvalue()


def write_table(heads: Iterable[str], rows: Iterable[Sequence[object]], path: Path) -> None:
    """Write one table as CSV.

    Raises:
        StorageError: the file cannot be written.
    """
    with storing(path):
        write_named(path, csv_text(heads, rows))
