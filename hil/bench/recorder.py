"""What the bench does, into the run folder: every block, every event, every part."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np

from hil.daq.contract import Block
from hil.record.folder import RunWriter

_PAUSE_S = 1.0  # between the samples of a run and those of the one that it resumes; how long it really was, nobody asks


class Recorder:
    """Keeps blocks in a run folder, their time counted from the first sample of the run.

    In a folder that holds the samples of an earlier run already, time goes on a second after the last of them.
    """

    def __init__(self, writer: RunWriter) -> None:
        self._writer = writer
        self._first_s = 0.0 if writer.last_s is None else writer.last_s + _PAUSE_S
        self._zero_s: float | None = None

    @property
    def name(self) -> str:
        """Of the run folder."""
        return str(self._writer.path)

    def time_of(self, block: Block) -> Any:
        """The stamps of a block on the time of the run, shape (n,)."""
        return block.time_s - (self._zero_s or 0.0)

    def keep(self, block: Block) -> None:
        """Write a block, as far as it is numbers. Raises `StorageError`."""
        if self._zero_s is None:
            self._zero_s = float(block.time_s[0]) - self._first_s
        values = block.columns
        numbers = np.logical_and.reduce([np.isfinite(column) for column in values.values()])
        if not numbers.all():  # a recording holds numbers alone; the guard ends the task
            self.note("readings that are no numbers", count=int(np.count_nonzero(~numbers)))
            values = {name: column[numbers] for name, column in values.items()}
        if numbers.any():
            self._writer.append(self.time_of(block)[numbers], values)
        if block.late:
            self.note("late samples", count=block.late)

    def note(self, event: str, **details: Any) -> None:
        """Write an event."""
        self._writer.event(event, **details)

    def mark(self, samples: int, details: Mapping[str, Any]) -> None:
        """The last so many samples kept were a part of the procedure."""
        self._writer.mark(samples, details)

    def part(self, details: Mapping[str, Any] | None) -> AbstractContextManager[None]:
        """Samples kept inside belong to a part of the procedure, if it is described."""
        return nullcontext() if details is None else self._writer.part(details)
