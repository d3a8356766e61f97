"""Events of a run, one JSON line each.

A line says what happened (`event`, `details`) and when: `row` (samples recorded so far), `time_s` (stamp of the
last of them), `utc`. Lines with a number in `part` delimit a part of the procedure (see `parts`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from io import FileIO
from pathlib import Path
from typing import Any

from hil.errors import FileError, reading
from hil.record.durable import copy_open, write_at
from hil.record.plain import to_json
from hil.untrusted import UNASKED_BYTES, parse_json, read_untrusted

EVENTS_FILE = "events.jsonl"


class EventsWriter:
    """Appends events; a line is whole or not there."""

    def __init__(self, folder: Path) -> None:
        self._file = FileIO(folder / EVENTS_FILE, "r+")
        self._bytes = 0
        self._sum = hashlib.sha256()

    @property
    def descriptor(self) -> int:
        """Of the file."""
        return self._file.fileno()

    @property
    def sha256(self) -> str:
        """Of everything written."""
        return self._sum.hexdigest()

    def append(self, event: Mapping[str, Any]) -> None:
        """Add an event; raises `OSError` when it cannot be written."""
        line = f"{to_json(event)}\n".encode()
        try:
            write_at(self._file, self._bytes, line)
        except OSError:
            self.trim()
            raise
        self._bytes += len(line)
        self._sum.update(line)

    def copy_to(self, folder: Path) -> None:
        """Write what is whole into the file of another folder; raises `OSError`."""
        self.trim()
        copy_open(self._file, folder / EVENTS_FILE)

    def trim(self) -> None:
        """Cut off a line that was interrupted."""
        self._file.truncate(self._bytes)

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()


def read_events(folder: Path) -> tuple[list[dict[str, Any]], int | None]:
    """The events of a run folder in order, and the number of the first line that is none, if there is one.

    A last line without its end was being written and is left out. Nothing after a bad line is read.

    Raises:
        FileError: the file cannot be read.
    """
    with reading(folder / EVENTS_FILE, remedy="; a run folder needs it"):
        return parse_events(read_untrusted(folder, EVENTS_FILE, UNASKED_BYTES))


def parse_events(text: bytes) -> tuple[list[dict[str, Any]], int | None]:
    """Like `read_events`, from text already read."""
    found: list[dict[str, Any]] = []
    for number, line in enumerate(text.split(b"\n")[:-1], 1):
        event = _event(line)
        if event is None:
            return found, number
        found.append(event)
    return found, None


def _event(line: bytes) -> dict[str, Any] | None:
    try:
        event = parse_json(line, EVENTS_FILE)
    except FileError:
        return None
    wanted = {"event": str, "row": int, "details": dict}
    good = isinstance(event, dict) and all(isinstance(event.get(key), kind) for key, kind in wanted.items())
    return event if good else None
