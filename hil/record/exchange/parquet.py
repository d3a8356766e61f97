"""Parquet: one column per channel called `name [unit]`, `time [s]` first; reads pandas' tables as well."""

from __future__ import annotations

from pathlib import Path

from hil.errors import FileError
from hil.record.about import KEY, about, parse_about
from hil.record.assemble import assemble
from hil.record.columns import Column, Table
from hil.record.extra import library
from hil.record.flat import flat
from hil.record.reading import AS_IT_IS, Reading
from hil.record.recording import Recording
from hil.record.response_table import ResponseTable

SUFFIXES = (".parquet", ".pq")


def read(path: Path, reading: Reading = AS_IT_IS) -> Recording | ResponseTable:
    """Read a recording.

    Raises:
        FileError: not Parquet, or without a time and a signal; names what is there.
    """
    pyarrow, parquet = library("pyarrow", path), library("pyarrow.parquet", path)
    try:
        table = parquet.read_table(path)
    except (OSError, pyarrow.ArrowException) as error:
        raise FileError(f"{path}: cannot be read as Parquet: {error}") from None
    meta, channels = parse_about((table.schema.metadata or {}).get(KEY.encode()))
    columns = []
    for heading, values in zip(table.column_names, table.columns, strict=True):
        bare = Column(heading, values.to_numpy())
        columns.append(Column(heading, bare.values, "", **channels.get(bare.name_and_unit[0], {})))
    return assemble(str(path), [Table(path.stem, columns)], meta, reading)


def write(recording: Recording, path: Path) -> None:
    """Write a recording."""
    pyarrow, parquet = library("pyarrow", path), library("pyarrow.parquet", path)
    recording = flat(recording)
    columns = {"time [s]": recording.time_s, **{c.heading: c.values for c in recording.channels.values()}}
    table = pyarrow.table(columns).replace_schema_metadata({KEY: about(recording)})
    parquet.write_table(table, path)
