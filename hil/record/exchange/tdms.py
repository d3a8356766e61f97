"""TDMS, National Instruments' format: one group, a `time` channel, units in `unit_string`.

Also read: waveforms (`wf_increment`), several groups, and files whose writer was killed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from hil.language.note import Note
from hil.record.extra import library
from hil.record.recording import Recording
from hil.record.table.about import KEY, about
from hil.record.table.columns import Column, Contents, Table, by_length, even_table, even_times, numbers

SUFFIXES = (".tdms",)
KIND = "TDMS"
LIBRARIES = ("nptdms",)
BEGINNING = rb"TDSm"
_UNIT_KEYS = ("unit_string", "NI_UnitDescription", "unit", "Unit")
_GROUP = "recording"
_NOT_SET = np.datetime64("1904-01-02")


def contents(path: Path, file: BinaryIO) -> Contents:
    """The tables of an open file; an index beside it is not looked at."""
    opened = library("nptdms", path).TdmsFile.read(file)
    first = _first_start(opened)
    stated = [numbers({**opened.properties, **group.properties}) for group in opened.groups()]
    groups = zip(opened.groups(), stated, strict=True)
    return [table for group, own in groups for table in _tables(group, first, own)], str(opened.properties.get(KEY, ""))


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


def _first_start(file: Any) -> np.datetime64 | None:
    """When the first waveform began; None unless all say when they did: then they count from one moment."""
    waves = [c for group in file.groups() for c in group.channels() if len(c) and c.properties.get("wf_increment")]
    starts = [_start(wave) for wave in waves]
    return None if not starts or None in starts else min(start for start in starts if start is not None)


def _start(wave: Any) -> np.datetime64 | None:
    start = wave.properties.get("wf_start_time")
    # the origin of the format's calendar stands for "not set", as with a time that is relative
    return None if start is None or np.datetime64(start) <= _NOT_SET else np.datetime64(start)


def _clock(wave: Any, first: np.datetime64 | None) -> tuple[float, float]:
    """Interval and first stamp of a waveform, in s."""
    late_s = 0.0 if first is None else float((_start(wave) - first) / np.timedelta64(1, "s"))  # type: ignore[operator]
    return float(wave.properties.get("wf_increment", 0.0)), float(wave.properties.get("wf_start_offset", 0.0)) + late_s


def _tables(group: Any, first: np.datetime64 | None, stated: Mapping[str, float]) -> Iterator[Table]:
    """The tables of a group; `stated`: numbers beside its channels, an interval or a rate perhaps among them."""
    waves = [channel for channel in group.channels() if len(channel)]
    columns = [_column(channel) for channel in waves]
    if any(column.is_time for column in columns):
        yield _cut_to_shortest(group.name, columns)
        return
    clocks = [_clock(wave, first if wave.properties.get("wf_increment") else None) for wave in waves]
    for clock in dict.fromkeys(clocks):
        for found in by_length([column for column, own in zip(columns, clocks, strict=True) if own == clock]):
            interval_s, start_s = clock
            if interval_s > 0:
                yield Table(group.name, found, even_times(len(found[0].values), interval_s, start_s))
            else:
                yield even_table(group.name, found, stated)


def _column(channel: Any) -> Column:
    unit = next((str(channel.properties[key]) for key in _UNIT_KEYS if channel.properties.get(key)), "")
    return Column(channel.name, channel[:], unit)


def _cut_to_shortest(name: str, columns: list[Column]) -> Table:
    # A writer that was killed leaves its channels a block apart.
    lengths = [len(column.values) for column in columns]
    if min(lengths) == max(lengths):
        return Table(name, columns)
    cut = [Column(c.heading, c.values[: min(lengths)], c.unit) for c in columns]
    note = Note("channels of group '{group}' have {least} to {most} samples; cut to the shortest", group=name,
                least=min(lengths), most=max(lengths))  # fmt: skip
    return Table(name, cut, assumed=note)
