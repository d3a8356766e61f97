"""The run folder: appended to while a procedure runs, readable at any moment, whole after a kill.

Contents: `run.json` and `end.json` (see `header`), `samples.f8` with its journal `samples.log` (see `samples`),
`events.jsonl` (see `events`). docs/reference/run-folder.md describes the format for other programs.
"""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from hil.record.parts import parts_of
from hil.record.plain import plain
from hil.record.recording import Channel, Recording, check
from hil.record.run_folder.events import EVENTS_FILE, read_events
from hil.record.run_folder.header import Column, Header, check_sealed, new_header, read_end, read_header
from hil.record.run_folder.run_writer import RunWriter
from hil.record.run_folder.samples import UNREADABLE, Mark, read_rows

__all__ = ["RunWriter", "read", "write"]

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
    rows = read_rows(path, len(header.samples.columns), None if end is None else Mark(end.rows, int(end.crc32, 16)))
    events, bad_line = read_events(path)
    stopped = {} if end is None else {**end.meta, "stopped_utc": end.stopped_utc.isoformat(), "outcome": end.outcome}
    meta = {
        **header.meta, "program": header.program, "started_utc": header.started_utc.isoformat(), **stopped,
        "parts": parts_of(events, rows.table[0]), "events": [event for event in events if "part" not in event],
    }  # fmt: skip
    lost_events = "" if bad_line is None else f"{EVENTS_FILE} {UNREADABLE.format(bad_line)}"
    if missing := "; ".join(filter(None, (rows.missing, lost_events))):
        meta["incomplete"] = missing
    columns = zip(header.samples.columns[1:], rows.table[1:], strict=True)
    channels = {c.name: Channel(c.name, c.unit, values, c.source, c.calibration) for c, values in columns}
    found = Recording(str(path), rows.table[0], channels, meta)
    if not rows.clean:
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
