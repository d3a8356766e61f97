"""The run folder: appended to while a procedure runs, readable at any moment, whole after a kill.

Contents: `run.json` and `end.json` (see `header`), `samples.f8` with its journal `samples.log` (see `samples`),
`events.jsonl` (see `events`). docs/reference/run-folder.md describes the format for other programs.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from hil.errors import FileError
from hil.record.parts import parts_of
from hil.record.plain import plain
from hil.record.recording import Array, Channel, Recording, check
from hil.record.run_folder.events import EVENTS_FILE, read_events
from hil.record.run_folder.header import Column, End, Header, check_sealed, new_header, read_end, read_header
from hil.record.run_folder.run_writer import RunWriter
from hil.record.run_folder.samples import JOURNAL_FILE, ROWS_FILE, VALUE_BYTES, Mark, last_good, last_mark, scan
from hil.untrusted import ANY_SIZE, open_untrusted

__all__ = ["RunWriter", "read", "write"]

# Up to this size samples are copied into memory, each channel in one piece; beyond, they stay on the disk.
COPIED_BYTES = 1 << 28
_PIECE_ROWS = 1 << 16
_OPEN = "the run was not closed: it is still being written, or its program was killed"
_OWN = ("program", "started_utc", "stopped_utc", "outcome", "parts", "events", "incomplete")


def read(path: Path) -> Recording:
    """Read a run folder, finished, broken off, or still being written.

    `meta` is what the header and the end say, with `program`, `started_utc`, `stopped_utc`, `outcome`, `parts`
    (see `parts.parts_of`) and `events`. `meta["incomplete"]` says what is missing, when something is. Channels
    of a large run are read-only views of the file, so that memory does not grow with it. What was no measurement is no
    finite number (see `hil.record.invalid_samples`).

    Raises:
        FileError: not a run folder, or a file in it is not what was written; names the file.
    """
    header, end = read_header(path), read_end(path)
    if end is not None:
        check_sealed(path, end)
    good = _good_rows(path, len(header.samples.columns), end)
    table = _table(path / ROWS_FILE, good.rows, len(header.samples.columns))
    events, bad_line = read_events(path)
    meta = _meta(header, end, events, table[0])
    lost_events = "" if bad_line is None else _unreadable(EVENTS_FILE, bad_line)
    if missing := "; ".join(filter(None, (good.missing, lost_events))):
        meta["incomplete"] = missing
    found = Recording(str(path), table[0], _channels(header, table[1:]), meta)
    if not good.clean:
        check(found, measured=False)
    return found


def write(recording: Recording, path: Path) -> None:
    """Write a recording as a closed run folder; its parts, events, dates and outcome go with it.

    Raises:
        FileError: the folder exists.
        StorageError: it cannot be written.
    """
    meta = recording.meta
    stopped = meta.get("stopped_utc")
    run = RunWriter(path, _header_of(recording))
    try:
        run.take_over(recording)
    finally:
        run.close(meta.get("outcome", "written"), stopped_utc=datetime.fromisoformat(stopped) if stopped else None)


def _header_of(recording: Recording) -> Header:
    channels = [
        Column(name=c.name, unit=c.unit, source=c.source, calibration=plain(c.calibration))
        for c in recording.channels.values()
    ]
    header = new_header(channels, {name: value for name, value in recording.meta.items() if name not in _OWN})
    known = {name: recording.meta[name] for name in ("program", "started_utc") if name in recording.meta}
    return Header.model_validate({**header.model_dump(), **known})


@dataclass(frozen=True, slots=True)
class _Good:
    """Rows that are what was written, whether they pass every check, and what is missing after them."""

    rows: int
    clean: bool
    missing: str = ""


def _good_rows(path: Path, columns: int, end: End | None) -> _Good:
    try:
        claimed, bad_line = last_mark(path) if end is None else (Mark(end.rows, int(end.crc32, 16)), None)
        found = scan(path, columns, claimed.rows)
        if found.mark == claimed:
            missing = _OPEN if end is None else ""
            if bad_line is not None:
                missing += f"; {_unreadable(JOURNAL_FILE, bad_line)}: samples after {claimed.rows} are lost"
            return _Good(claimed.rows, found.clean and claimed.rows > 1, missing)
        good = last_good(path, columns)
        clean = scan(path, columns, good.rows).clean and good.rows > 1
    except OSError as error:
        raise FileError(f"{error.filename}: cannot be read: {error.strerror}; a run folder needs it") from None
    if end is not None and found.mark.rows == claimed.rows:
        raise FileError(
            f"{path / ROWS_FILE}: changed after the run was closed, from row {good.rows} on: CRC-32 "
            f"{found.mark.crc32:08x}, expected {claimed.crc32:08x} over {claimed.rows} rows"
        )
    return _Good(good.rows, clean, f"of {claimed.rows} rows only the first {good.rows} are in {ROWS_FILE}")


def _unreadable(name: str, bad_line: int) -> str:
    return f"{name} cannot be read from line {bad_line} on"


def _table(path: Path, rows: int, columns: int) -> Array:
    with open_untrusted(path.parent, path.name, ANY_SIZE) as file:
        if rows * columns * VALUE_BYTES > COPIED_BYTES:
            return np.asarray(np.memmap(file, "<f8", "r", shape=(rows, columns))).T
        table = np.empty((columns, rows))
        for first in range(0, rows, _PIECE_ROWS):  # the whole of it twice in memory costs more than to read it
            piece = table[:, first : first + _PIECE_ROWS]
            piece.T[:] = np.fromfile(file, "<f8", piece.size).reshape(-1, columns)
        return table


def _channels(header: Header, table: Array) -> dict[str, Channel]:
    return {
        column.name: Channel(column.name, column.unit, values, column.source, column.calibration)
        for column, values in zip(header.samples.columns[1:], table, strict=True)
    }


def _meta(header: Header, end: End | None, events: list[dict[str, Any]], time_s: Array) -> dict[str, Any]:
    stopped = {} if end is None else {**end.meta, "stopped_utc": end.stopped_utc.isoformat(), "outcome": end.outcome}
    return {
        **header.meta, "program": header.program, "started_utc": header.started_utc.isoformat(), **stopped,
        "parts": parts_of(events, time_s), "events": [event for event in events if "part" not in event],
    }  # fmt: skip
