"""What the bench does, into the run folder: every block, every event, every part."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np

from hil.daq.channel import InputChannel
from hil.daq.contract import Block
from hil.record.folder import RunWriter
from hil.record.invalid_samples import AGAIN, AT_END, NONE, is_measured

_PAUSE_S = 1.0  # between the samples of a run and those of the one that it resumes; how long it really was, nobody asks


class Recorder:
    """Keeps blocks in a run folder, their time counted from the first sample of the run.

    In a folder that holds the samples of an earlier run already, time goes on a second after the last of them.

    Args:
        writer: of the run folder.
        inputs: by name, with their ranges: events name them where an input is not measured.
    """

    def __init__(self, writer: RunWriter, inputs: Mapping[str, InputChannel]) -> None:
        self._writer = writer
        self._inputs = inputs
        self._first_s = 0.0 if writer.last_s is None else writer.last_s + _PAUSE_S
        self._zero_s: float | None = None
        self._lacking: dict[str, int] = {}

    @property
    def name(self) -> str:
        """Of the run folder."""
        return str(self._writer.path)

    def time_of(self, block: Block) -> Any:
        """The stamps of a block on the time of the run, shape (n,)."""
        return block.time_s - (self._zero_s or 0.0)

    def keep(self, block: Block) -> None:
        """Write a block, as it is. Raises `StorageError`."""
        if self._zero_s is None:
            self._zero_s = float(block.time_s[0]) - self._first_s
        time_s = self.time_of(block)
        self._writer.append(time_s, block.columns)
        for name, channel in self._inputs.items():
            self._follow(channel, block.inputs[name], time_s, block.invalid_reasons.get(name, ""))
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

    def _follow(self, channel: InputChannel, values: Any, time_s: Any, why: str) -> None:
        """Write when an input stops being measured, and the first block in which it is measured throughout again."""
        if is_measured(values):
            if samples := self._lacking.pop(channel.name, 0):
                self.note(AGAIN, channel=channel.name, samples_lost=samples)
            return
        lacking = ~np.isfinite(values)
        if channel.name not in self._lacking:
            at = int(np.argmax(lacking))
            event = NONE if np.isnan(values[at]) else AT_END
            reason = {"why": why} if why else {}
            self.note(event, channel=channel.name, from_s=time_s[at], low=channel.low, high=channel.high, **reason)
        self._lacking[channel.name] = self._lacking.get(channel.name, 0) + int(np.count_nonzero(lacking))
