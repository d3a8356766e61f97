"""Logs of a CAN bus (Vector's `.asc` and `.blf`, PEAK's `.trc`, candump), read only, by the DBC file beside them."""

from __future__ import annotations

import io
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from hil.errors import FileError
from hil.language.note import Note
from hil.record.extra import library
from hil.record.gathered import gathered, parts_of, text_of, whole
from hil.record.table.columns import Column, Contents, Table

SUFFIXES = (".blf", ".trc")
BEGINNING = rb"LOGG|;\$FILEVERSION=|date \w+\.? \w+\.? \d+ \d|\(\d+\.\d+\) \w+ [0-9A-F]"
KIND = "a CAN log"
LIBRARIES = ("can", "cantools")
_READERS = {b"LO": "BLFReader", b";": "TRCReader", b"da": "ASCReader", b"(": "CanutilsLogReader"}
_NAMED = 3
_Samples = dict[tuple[str, str, str], tuple[list[float], list[float]]]


def files_of(path: Path, file: BinaryIO) -> BinaryIO:
    """The log and its DBC: that of its name, or the only one in its folder.

    Raises:
        FileError: it is no log; there is no DBC, or several of other names.
    """
    log = file.read()
    _reader(path, log)
    named, found = path.with_suffix(".dbc"), sorted(path.parent.glob("*.dbc"))
    if not named.is_file() and len(found) != 1:
        there = f"; there are {', '.join(one.name for one in found[:_NAMED])}" if found else ""
        raise FileError(f"{path}: is a CAN log, and its signals need a DBC file: put it beside, as {named.name}{there}")
    dbc = named if named.is_file() else found[0]
    return gathered(dbc.name.encode(), whole(dbc), log)


def contents(path: Path, file: BinaryIO) -> Contents:
    """The signals of a log by its DBC, each at the stamps of its message.

    Raises:
        FileError: no frame is one that the DBC describes.
    """
    name, dbc, log = parts_of(file)
    reader = _reader(path, log)
    opened: Any = io.BytesIO(log) if reader == "BLFReader" else io.StringIO(text_of(log))
    frames = getattr(library("can", path), reader)(opened)
    known = library("cantools", path).database.load_string(text_of(dbc), "dbc", strict=False)
    messages = {(one.frame_id, one.is_extended_frame): one for one in known.messages}
    samples, unknown = _decoded(frames, messages)
    if not samples:
        ids = ", ".join(f"0x{frame_id:X}" for frame_id in sorted(unknown)[:_NAMED]) or "none"
        raise FileError(f"{path}: no frame of the log is in {name.decode()}; its identifiers: {ids}")
    start_s = min(stamps[0] for stamps, _ in samples.values())
    note = Note("signals by {dbc}, time from the first", dbc=name.decode())
    if unknown:
        note = Note("{note}; frames of {count} identifiers are not in it", note=note, count=len(unknown))
    return list(_tables(samples, start_s, note)), ""


def _reader(path: Path, log: bytes) -> str:
    """What python-can calls the reader of a log that begins so."""
    for start, reader in _READERS.items():
        if log.startswith(start):
            return reader
    raise FileError(f"{path}: cannot be read as a CAN log: it begins like none of Vector, PEAK or candump")


def _tables(samples: _Samples, start_s: float, note: Note) -> Iterator[Table]:
    """Signals of one message that stand in the same frames as one table."""
    together: dict[tuple[str, tuple[float, ...]], list[Column]] = defaultdict(list)
    for (message, signal, unit), (stamps, values) in samples.items():
        together[message, tuple(stamps)].append(Column(signal, np.array(values, dtype=np.float64), unit))
    for (message, read_s), columns in together.items():
        yield Table(message, columns, np.array(read_s) - start_s, note)


def _decoded(frames: Iterable[Any], messages: dict[tuple[int, bool], Any]) -> tuple[_Samples, set[int]]:
    """Stamps and values by message, signal and unit; and identifiers that no message has."""
    samples: _Samples = defaultdict(lambda: ([], []))
    unknown = set()
    units = {message.name: {signal.name: signal.unit or "" for signal in message.signals} for message in
             messages.values()}  # fmt: skip
    for frame in frames:
        if frame.is_error_frame or frame.is_remote_frame:
            continue
        message = messages.get((frame.arbitration_id, frame.is_extended_id))
        if message is None:
            unknown.add(frame.arbitration_id)
            continue
        for signal, value in message.decode(frame.data, decode_choices=False, allow_truncated=True).items():
            stamps, values = samples[message.name, signal, units[message.name][signal]]
            stamps.append(frame.timestamp)
            values.append(value)
    return samples, unknown
