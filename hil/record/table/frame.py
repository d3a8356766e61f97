"""Recordings from memory: a pandas DataFrame, or arrays under their headings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeGuard

import numpy as np

from hil.errors import FileError
from hil.record.reading import AS_IT_IS, Reading
from hil.record.recording import Recording
from hil.record.table.assemble import assemble
from hil.record.table.columns import Column, Table
from hil.record.table.response_table import ResponseTable

if TYPE_CHECKING:
    import pandas as pd


def is_frame(source: Any) -> TypeGuard[pd.DataFrame]:
    """Whether it is a pandas DataFrame; pandas is not imported for that."""
    return any(
        kind.__module__.split(".")[0] == "pandas" and kind.__name__ == "DataFrame" for kind in type(source).__mro__
    )


def from_memory(source: pd.DataFrame | Mapping[str, Any], reading: Reading | None = None) -> Recording | ResponseTable:
    """A recording, or the table of a frequency response, from columns called `name [unit]`.

    The time is a column as in a file, or the index of a DataFrame when its name or its stamps say that it is one.

    Args:
        source: DataFrame, or arrays of shape (n,) by heading: `{"time [s]": t, "command [%]": u, "flow [l/min]": y}`.
        reading: what its user says besides.

    Raises:
        FileError: columns of different lengths or without names, or what `assemble` does not take for a recording.
    """
    if not is_frame(source) and hasattr(source, "to_pandas") and not isinstance(source, Mapping):  # pyarrow, polars
        source = source.to_pandas()
    if is_frame(source):
        name, columns = "the DataFrame", [Column(str(heading), _plain(source[heading])) for heading in source.columns]
        index = Column(str(source.index.name or "row"), source.index.to_numpy())
        columns = [index, *columns] if index.is_time or index.is_dated else columns
    elif isinstance(source, Mapping):
        name = "the arrays"
        columns = [Column(str(heading), _numbers(np.asarray(values))) for heading, values in source.items()]
    else:
        raise FileError(
            f"a {type(source).__name__}: a recording is a path, a DataFrame, or arrays by name and unit: "
            "{'time [s]': t, 'command [%]': u, 'flow [l/min]': y}"
        )
    for column in columns:
        if column.values.ndim != 1:
            shape = "×".join(map(str, column.values.shape)) or "a single value"
            raise FileError(f"{name}: '{column.heading}' is {shape}; a channel is an array of one value a sample")
    if len(lengths := {len(column.values) for column in columns}) > 1:
        counts = ", ".join(f"'{column.heading}' {len(column.values)}" for column in columns)
        raise FileError(f"{name}: {len(lengths)} different lengths: {counts}; all columns have one value a sample")
    return assemble(name, [Table(name, columns)], None, reading or AS_IT_IS)


def _plain(series: Any) -> Any:
    """Its values; of a column that pandas keeps in a type of its own, as numbers with NaN."""
    if isinstance(getattr(series, "dtype", None), np.dtype):
        return _numbers(series.to_numpy())
    try:
        return series.to_numpy(dtype=np.float64, na_value=np.nan)
    except (TypeError, ValueError):
        return series.to_numpy()


def _numbers(values: Any) -> Any:
    """Values of a column of objects as numbers, where they are some: those of a database are such."""
    if values.dtype.kind != "O" or values.ndim != 1:
        return values
    try:
        return values.astype(np.float64)
    except (TypeError, ValueError):
        return values
