"""Following a run while it is being written, from any process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from hil.errors import reading
from hil.record.recording import Channel, Recording
from hil.record.run_folder.events import EVENTS_FILE, parse_events
from hil.record.run_folder.header import END_FILE, Header, read_header
from hil.record.run_folder.samples import ROWS_FILE, VALUE_BYTES, last_mark

MOST_ROWS = 100_000


class Tail:
    """Reads what has come since it last looked; never sees a row or an event that is only half written.

    Checksums are left to `folder.read`: what the operating system has been given is read back as it was.

    Attributes:
        header: what was known at the start of the run.
        finished: it was closed, and the last `samples` returned its end.
    """

    def __init__(self, path: str | Path) -> None:
        self._path = Path(path)
        self.header: Header = read_header(self._path)
        self._rows = 0
        self._event_bytes = 0
        self.finished = False

    def samples(self, most: int = MOST_ROWS) -> Recording:
        """The next samples, at most so many; none (length 0) when nothing new has come.

        Raises:
            FileError: the folder went away.
        """
        closed = (self._path / END_FILE).exists()  # asked first: afterwards nothing more comes
        columns = self.header.samples.columns
        with reading(self._path, "cannot be followed any more"):
            there = last_mark(self._path)[0].rows
            rows = min(there - self._rows, most)
            place = self._rows * len(columns) * VALUE_BYTES
            table = np.fromfile(self._path / ROWS_FILE, "<f8", rows * len(columns), offset=place)
        time_s, *values = table.reshape(rows, len(columns)).T.copy()
        self._rows += rows
        self.finished = closed and self._rows == there
        channels = {c.name: Channel(c.name, c.unit, v) for c, v in zip(columns[1:], values, strict=True)}
        return Recording(str(self._path), time_s, channels, self.header.meta)

    def events(self) -> list[dict[str, Any]]:
        """The events that have come since the last call, parts' starts and stops among them."""
        with (self._path / EVENTS_FILE).open("rb") as file:
            file.seek(self._event_bytes)
            new = file.read()
        whole = new[: new.rfind(b"\n") + 1]
        self._event_bytes += len(whole)
        return parse_events(whole)[0]
