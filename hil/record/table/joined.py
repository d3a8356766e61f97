"""Recordings of several files as one: a file for each channel, or for each device."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hil.errors import FileError
from hil.record.recording import Recording
from hil.record.table.assemble import ORIGIN, assemble
from hil.record.table.columns import Column, Table

_NS = 1e9


def joined(recordings: Sequence[Recording]) -> Recording:
    """All channels on one clock, as those of several tables in one file (see `assemble`).

    Stamps of a calendar count together; other clocks are those of one device, and their numbers are kept.

    Raises:
        FileError: some say a date and others do not, or they have no time in common.
    """
    dated = [one.name for one in recordings if ORIGIN in one.meta]
    if dated and len(dated) < len(recordings):
        other = next(one.name for one in recordings if ORIGIN not in one.meta)
        raise FileError(f"{other}: its time is no date, that of {dated[0]} is: nobody can say how far they lie apart")
    found = assemble(recordings[0].name, [table for one in recordings for table in _tables(one)])
    if not isinstance(found, Recording):
        raise FileError(f"{found.name}: together they are a frequency response, no recording")
    notes = [f"{Path(one.name).name}: {note}" for one in recordings for note in one.meta.get("assumed", ())]
    return Recording(found.name, found.time_s, found.channels,
                     {**found.meta, "assumed": [*notes, *found.meta.get("assumed", ())]}, found.own)  # fmt: skip


def _tables(one: Recording) -> list[Table]:
    made = []
    for channel in one.channels.values():
        taken = one.samples(channel.name)
        clock = Column("time", taken.time_s, "s")
        if ORIGIN in one.meta:
            since = np.round(_NS * taken.time_s).astype("timedelta64[ns]")
            clock = Column("time", np.datetime64(one.meta[ORIGIN], "ns") + since)
        unit = "" if channel.name in one.meta.get("units_missing", ()) else channel.unit
        column = Column(channel.name, taken.values, unit, channel.source, channel.calibration or {})
        made.append(Table(Path(one.name).stem, [clock, column]))
    return made
