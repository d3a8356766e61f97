"""Recordings and tables of frequency responses: read, written, averaged."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from hil.api.callbacks import NOTHING
from hil.errors import options_of
from hil.session.several import at_least_one, several

if TYPE_CHECKING:
    from hil.record.reading import Reading
    from hil.record.recording import Recording
    from hil.record.table.response_table import ResponseTable
    from hil.session.sources import Source


@options_of("python")
def read(
    path: Source,
    *,
    time: str = "",
    interval_s: float = 0.0,
    units: Mapping[str, str] = NOTHING,
    renamed: Mapping[str, str] = NOTHING,
    columns: str | Iterable[str] = (),
    gaps: bool = False,
    responses: bool = False,
    part: str = "",
) -> Recording | ResponseTable:
    """A recording, a run folder, or a table of a frequency response; `hil convert` and all that read do the same.

    Args:
        path: file or run folder; also a DataFrame, or arrays by their headings `name [unit]`.
        time: name of the column that holds the time.
        interval_s: the samples lie so far apart, whatever the file says.
        units: of channels by name, whatever the file says.
        renamed: new names of channels by their old ones.
        columns: names of the columns in their order, for files without headings; `-` leaves one out.
        gaps: whether an empty field, or a line that is cut off, is a sample that was not taken.
        responses: of a run that measured frequency responses, those and not its samples.
        part: of a run that measured several, the one of this name.

    Raises:
        FileError: it cannot be read as a recording; names line, column and the option that helps.
    """
    from hil.record.reading import Reading
    from hil.session.sources import read_source

    reading = Reading(time, interval_s, dict(units), dict(renamed), tuple(several(columns)), gaps)
    return read_source(path, reading, responses=responses, part=part)


@options_of("python")
def write(recording: Recording | ResponseTable, path: str | Path) -> None:
    """Write a recording or a table; the ending of the name says the format, none makes a run folder of a recording.

    Raises:
        FileError: an ending that is not known, or a run folder that exists.
    """
    from hil.record.read import write_recording
    from hil.record.table.response_table import ResponseTable, write_response_table

    if isinstance(recording, ResponseTable):
        write_response_table(recording, Path(path))
    else:
        write_recording(recording, Path(path))


@options_of("python")
def average(
    responses: Source | Iterable[Source], *, normalised: bool = False, reading: Reading | None = None, part: str = ""
) -> ResponseTable:
    """The mean of frequency responses on the same frequencies: mean dB and mean phase (`hil average`).

    Args:
        responses: tables, paths of tables or of runs, or names of installed tables.
        normalised: take each over its gain at the lowest frequency first.
        reading: how paths are read.
        part: of runs that measured several responses, this one.
    """
    from hil.identification.frequency.table_fit import averaged
    from hil.session.sources import tables_of

    return averaged(tables_of(at_least_one(responses), reading, part), normalised=normalised)
