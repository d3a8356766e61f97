"""Parquet: one column per channel called `name [unit]`, `time [s]` first; reads pandas' tables as well."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from hil.errors import FileError
from hil.record.extra import library
from hil.record.recording import Recording
from hil.record.table.about import KEY, about
from hil.record.table.columns import Column, Contents, Table
from hil.untrusted import most_unpacked, unpacked_allowed

SUFFIXES = (".parquet", ".pq")
KIND = "Parquet"
LIBRARIES = ("pyarrow.parquet",)
BEGINNING = rb"PAR1"
_VALUE_BYTES = 8


def contents(path: Path, file: BinaryIO) -> Contents:
    """The tables of an open file.

    Raises:
        FileError: it holds more than is read.
    """
    parquet = library("pyarrow.parquet", path)
    opened, stored_bytes = parquet.ParquetFile(file), os.fstat(file.fileno()).st_size
    if (size := opened.metadata.num_rows * opened.metadata.num_columns * _VALUE_BYTES) > most_unpacked(stored_bytes):
        raise FileError(
            f"{path}: says that it holds {opened.metadata.num_rows} rows of {opened.metadata.num_columns} columns, "
            f"{size / 1e9:.3g} GB; {unpacked_allowed(stored_bytes)}"
        )
    table = opened.read(use_threads=False)
    columns = [Column(name, _values(column)) for name, column in zip(table.column_names, table.columns, strict=True)]
    return [Table(path.stem, columns)], (table.schema.metadata or {}).get(KEY.encode(), b"").decode(errors="replace")


def _values(column: Any) -> NDArray[Any]:
    """The values of a column; decimals, as databases write them, as numbers."""
    values: NDArray[Any] = column.to_numpy()
    if not str(column.type).startswith("decimal"):
        return values
    return np.array([np.nan if value is None else value for value in values], np.float64)


def write(recording: Recording, path: Path) -> None:
    """Write a recording."""
    pyarrow, parquet = library("pyarrow", path), library("pyarrow.parquet", path)
    columns = {"time [s]": recording.time_s, **{c.heading: c.values for c in recording.channels.values()}}
    table = pyarrow.table(columns).replace_schema_metadata({KEY: about(recording)})
    parquet.write_table(table, path)
