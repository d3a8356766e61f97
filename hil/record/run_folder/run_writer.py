"""Writing a run folder: block by block, while the procedure runs."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from hil.errors import FileError, StorageError
from hil.record.durable import Syncer, sync_file, sync_folder
from hil.record.parts import PLACE, STARTED, STOPPED, as_events
from hil.record.plain import plain
from hil.record.recording import Array, Recording
from hil.record.run_folder.events import EVENTS_FILE, EventsWriter
from hil.record.run_folder.header import (
    HEADER_FILE,
    Column,
    End,
    Header,
    new_header,
    open_end,
    sha256_of,
    write_end,
    write_header,
)
from hil.record.run_folder.samples import JOURNAL_FILE, ROWS_FILE, RowsWriter
from hil.record.run_folder.thinned import Thinning
from hil.system import system

_CHUNK_ROWS = 1 << 12  # are lost at most when a disk is full


class RunWriter:
    """Writes one run folder. When `append` or `event` returns, what it got survives the death of this process.

    It survives a power cut once it is synced, a second later at most. To be used from one thread.

    Attributes:
        path: the run folder.
        header: what was known at the start.
    """

    def __init__(self, path: Path, header: Header) -> None:
        _make_folder(path, header)
        self.path = path
        self.header = header
        self._names = tuple(column.name for column in header.samples.columns)
        self._rows = RowsWriter(path, len(self._names))
        self._events = EventsWriter(path)
        self._end_room = open_end(path)
        self._header_sum = sha256_of(path / HEADER_FILE)
        self._syncer = Syncer((*self._rows.descriptors, self._events.descriptor))
        self._parts = 0
        self._thinning = Thinning({})
        self._closed = self._loss_is_noted = False

    @classmethod
    def create(cls, path: str | Path, header: Mapping[str, Any], channels: Sequence[tuple[str, str] | Column]) -> Self:
        """Start a run in a folder that does not exist yet; it appears at once with all its files.

        Args:
            path: the folder; missing parents are made.
            header: what is known now, as JSON values (numpy, dataclasses and dates are converted).
            channels: `(name, unit)`, or a `Column` with source and calibration; without the time.

        Raises:
            FileError: the folder exists.
            StorageError: it cannot be made.
        """
        return cls(Path(path), new_header(channels, header))

    @property
    def rows(self) -> int:
        """Samples recorded so far."""
        return self._rows.mark.rows

    @property
    def last_s(self) -> float | None:
        """Stamp of the last sample; None before the first."""
        return self._rows.last_s

    def append(self, time_s: Array, values: Mapping[str, Array]) -> None:
        """Add a block: stamps of shape (n,) and, for every channel, n values.

        Raises:
            StorageError: it could not be written, or its time does not go on from the last sample. What was
                recorded before is kept. Once, also, when the folder was deleted or moved; what comes then is kept too.
            ValueError: other channels than declared, or of another length.
        """
        time_s = np.asarray(time_s, dtype=np.float64)
        self._check_block(time_s, values)
        columns = [time_s, *(values[name] for name in self._names[1:])]
        for start in range(0, len(time_s), _CHUNK_ROWS):
            table = np.stack([column[start : start + _CHUNK_ROWS] for column in columns], axis=1)
            self._write(self._thinning.kept(table))
        if self._rows.is_away and not self._loss_is_noted:
            self._loss_is_noted = True
            how = "deleted" if self._rows.is_deleted else "moved"
            raise StorageError(f"{self.path}: the run folder was {how}; {self._kept()}")

    def event(self, event: str, /, **details: Any) -> None:
        """Write down that something happened now: a level reached, a trip, a decision."""
        self._event_now(event, details)

    @contextmanager
    def part(self, details: Mapping[str, Any]) -> Iterator[None]:
        """Samples appended inside belong to one part of the procedure, described by `details`.

        `details` must not use the names under which its place is kept: first, count, start_s, stop_s,
        unfinished. A part left by an exception is marked unfinished. One with `rows_kept` is recorded in these rows
        alone (see `hil.record.run_folder.thinned`).
        """
        self._thinning = thinning = Thinning(details)
        number = self._new_part(details)
        self._event_now(STARTED, details, part=number)
        try:
            yield
        except BaseException:
            if thinning.held is not None:
                with suppress(StorageError):  # what ended the part is raised
                    self._write(thinning.held)
            self._event_now(STOPPED, {"unfinished": True}, part=number)
            raise
        finally:
            self._thinning = Thinning({})
        self._event_now(STOPPED, {}, part=number)

    def mark(self, count: int, details: Mapping[str, Any]) -> None:
        """The last `count` rows were a part of the procedure, described by `details` as in `part`.

        Raises:
            ValueError: there are not so many rows, or `details` uses a name of the place.
        """
        if not 0 < count <= self.rows:
            raise ValueError(f"the last {count} of {self.rows} rows cannot be a part")
        number = self._new_part(details)
        self.record_event({"event": STARTED, "row": self.rows - count, "part": number, "details": plain(details)})
        self._event_now(STOPPED, {}, part=number)

    def take_over(self, earlier: Recording) -> None:
        """Begin with the samples, parts and events of another recording, as they stand there.

        Raises:
            ValueError: something was recorded here before, or the channels are others.
        """
        if self.rows or self._parts:
            raise ValueError("another recording can be taken over only before anything is recorded")
        self.append(earlier.time_s, {name: channel.values for name, channel in earlier.channels.items()})
        parts = earlier.meta.get("parts", ())
        for event in sorted((*as_events(parts), *earlier.meta.get("events", ())), key=lambda event: int(event["row"])):
            self.record_event(event)
        self._parts = len(parts)

    def record_event(self, event: Mapping[str, Any]) -> None:
        """Add an event as it stands, with its own time: from another run."""
        with self._storing():
            self._events.append(event)
        self._syncer.written()

    def close(self, outcome: str = "completed", *, stopped_utc: datetime | None = None, **meta: Any) -> None:
        """Seal the run; a second call does nothing.

        Args:
            outcome: how it ended, in a word or a sentence.
            stopped_utc: when, if not now.
            meta: whatever else is known only at the end, as JSON values.

        Raises:
            StorageError: the last samples or the end could not be brought to the disk.

        A folder that was deleted meanwhile is made again, with everything that was recorded: under its own name, or
        beside it if something is there. One that was moved is sealed where it is. `path` says where.
        """
        if self._closed:
            return
        self._closed = True
        try:
            with self._storing():
                self._settle()
                if self._rows.is_deleted:
                    self._restore()
                elif self._rows.is_away:
                    self._follow()
                write_end(self.path, self._end_room, self._end(outcome, stopped_utc, meta))
        finally:
            self._rows.close()
            self._events.close()
            self._end_room.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close("completed" if error is None else f"{type(error).__name__}: {error}")

    def _check_block(self, time_s: Array, values: Mapping[str, Array]) -> None:
        if set(values) != set(self._names[1:]):
            raise ValueError(f"declared channels: {', '.join(self._names[1:])}; found: {', '.join(values) or 'none'}")
        for name, column in values.items():
            if np.shape(column) != (len(time_s),):
                raise ValueError(f"channel '{name}' has shape {np.shape(column)}, time has {time_s.shape}")
        before = -np.inf if self.last_s is None else self.last_s
        # What goes on from sample to sample is finite but perhaps at its end.
        if len(time_s) and not (before < time_s[0] and time_s[-1] < np.inf and (time_s[1:] > time_s[:-1]).all()):
            late = np.flatnonzero(~(np.diff(time_s, prepend=before) > 0) | ~np.isfinite(time_s))
            raise StorageError(
                f"{self.path}: sample {self.rows + late[0]}: time {time_s[late[0]]:g} s does not come after the "
                f"sample before it; this block is not recorded, {self._kept()}"
            )

    def _write(self, table: Array) -> None:
        if not len(table):
            return
        with self._storing():
            self._syncer.check()
            self._rows.append(np.ascontiguousarray(table, dtype="<f8"))
        self._syncer.written()

    def _new_part(self, details: Mapping[str, Any]) -> int:
        if taken := set(details) & set(PLACE):
            raise ValueError(f"part details must not be named {', '.join(sorted(taken))}")
        self._parts += 1
        return self._parts - 1

    def _event_now(self, event: str, details: Mapping[str, Any], **more: int) -> None:
        when = {"row": self.rows, "time_s": self.last_s, "utc": system.utc()}
        self.record_event({"event": event, **when, **more, "details": details})

    def _settle(self) -> None:
        try:
            self._rows.trim()
            self._events.trim()
        finally:
            self._syncer.stop()

    def _restore(self) -> None:
        """Make the folder again from the files that are still open."""
        self._event_now("the run folder was deleted, and made again", {"samples": self.rows})
        if self.path.exists():
            self.path = self.path.with_name(f"{self.path.name}-restored")
        _make_folder(self.path, self.header)
        self._rows.copy_to(self.path)
        self._events.copy_to(self.path)
        self._end_room.close()
        self._end_room = open_end(self.path)

    def _follow(self) -> None:
        """Go on where the folder was moved to; where nobody knows that, its end belongs nowhere."""
        place = self._rows.folder
        if place is not None:
            self._event_now("the run folder was moved", {"from": str(self.path)})
            self.path = place

    def _end(self, outcome: str, stopped_utc: datetime | None, meta: Mapping[str, Any]) -> End:
        mark = self._rows.mark
        return End(
            outcome=outcome, stopped_utc=stopped_utc or system.utc(), rows=mark.rows, crc32=f"{mark.crc32:08x}",
            sha256={HEADER_FILE: self._header_sum, EVENTS_FILE: self._events.sha256, **self._rows.sha256},
            outputs=plain(meta).get("outputs", {}), meta=plain(meta),
        )  # fmt: skip

    @contextmanager
    def _storing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            remedy = "; free some space" if error.errno in (errno.ENOSPC, errno.EDQUOT) else ""
            raise StorageError(
                f"{self.path}: cannot be written: {error.strerror or error}{remedy}; {self._kept()}"
            ) from error

    def _kept(self) -> str:
        return f"{self.rows} samples up to {self.last_s or 0.0:g} s are kept"


def _make_folder(path: Path, header: Header) -> None:
    """Make a run folder with all its files; it appears whole or not at all.

    Raises:
        FileError: there is something of that name already.
        StorageError: it cannot be made.
    """
    if path.exists():
        raise FileError(f"{path}: exists already; a run is never written over another, choose another folder")
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.mkdir(parents=True)
        write_header(part, header)
        for name in (ROWS_FILE, JOURNAL_FILE, EVENTS_FILE):
            (part / name).touch()
        for file in part.iterdir():
            with file.open("r+b") as opened:
                sync_file(opened.fileno())
        sync_folder(part)
        part.rename(path)
        sync_folder(path.parent)
    except OSError as error:
        shutil.rmtree(part, ignore_errors=True)
        raise StorageError(f"{path}: the run folder cannot be made: {error.strerror}") from error
