"""TDMS, National Instruments' format: one group, a `time` channel, units in `unit_string`.

Also read: waveforms (`wf_increment`), several groups, and files whose writer was killed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hil.errors import FileError
from hil.record.about import KEY, about, parse_about
from hil.record.assemble import assemble
from hil.record.columns import Column, Table, by_length
from hil.record.extra import library
from hil.record.recording import Recording

SUFFIXES = (".tdms",)
_UNIT_KEYS = ("unit_string", "NI_UnitDescription", "unit", "Unit")
_GROUP = "recording"


def read(path: Path) -> Recording:
    """Read a recording.

    Raises:
        FileError: not TDMS, or without a time and a signal; names what is there.
    """
    nptdms = library("nptdms", path)
    try:
        file = nptdms.TdmsFile.read(path)
    except Exception as error:  # nptdms raises what its parser happens to stumble over
        raise FileError(f"{path}: cannot be read as TDMS: {error}") from None
    meta, channels = parse_about(file.properties.get(KEY))
    return assemble(str(path), [table for group in file.groups() for table in _tables(group, channels)], meta)


def write(recording: Recording, path: Path) -> None:
    """Write a recording as one group."""
    nptdms = library("nptdms", path)
    with nptdms.TdmsWriter(path) as file:
        file.write_segment([
            nptdms.RootObject({KEY: about(recording)}),
            nptdms.GroupObject(_GROUP),
            nptdms.ChannelObject(_GROUP, "time", recording.time_s, {"unit_string": "s"}),
            *(
                nptdms.ChannelObject(_GROUP, channel.name, channel.values, {"unit_string": channel.unit})
                for channel in recording.channels.values()
            ),
        ])  # fmt: skip


def _tables(group: Any, channels: Mapping[str, Mapping[str, Any]]) -> Iterator[Table]:
    waves = [channel for channel in group.channels() if len(channel)]
    columns = [_column(channel, channels) for channel in waves]
    if any(column.is_time for column in columns):
        yield _cut_to_shortest(group.name, columns)
        return
    clocks = [(float(wave.properties.get("wf_increment", 0.0)), float(wave.properties.get("wf_start_offset", 0.0)))
              for wave in waves]  # fmt: skip
    for clock in dict.fromkeys(clocks):
        for found in by_length([column for column, own in zip(columns, clocks, strict=True) if own == clock]):
            interval_s, start_s = clock
            time_s = (
                start_s + interval_s * np.arange(len(found[0].values), dtype=np.float64) if interval_s > 0 else None
            )
            yield Table(group.name, found, time_s)


def _column(channel: Any, channels: Mapping[str, Mapping[str, Any]]) -> Column:
    unit = next((str(channel.properties[key]) for key in _UNIT_KEYS if channel.properties.get(key)), "")
    return Column(channel.name, channel[:], unit, **channels.get(channel.name, {}))


def _cut_to_shortest(name: str, columns: list[Column]) -> Table:
    # A writer that was killed leaves its channels a block apart.
    lengths = [len(column.values) for column in columns]
    if min(lengths) == max(lengths):
        return Table(name, columns)
    cut = [Column(c.heading, c.values[: min(lengths)], c.unit, c.source, c.calibration) for c in columns]
    said = f"channels of group '{name}' have {min(lengths)} to {max(lengths)} samples; cut to the shortest"
    return Table(name, cut, assumed=said)
