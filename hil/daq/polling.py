"""What a reader and the polling thread share: the task, how it keeps its time, and the samples on their way."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from queue import Empty, SimpleQueue

import numpy as np

from hil.clock import Flag
from hil.daq.contract import Block, Waveform
from hil.errors import LinkError, OutputUnderflowError
from hil.system import system

BEHIND_S = 1.0  # a program that brings no waveform for so long has lost the task
_FEWEST_SLOW = 3  # samples that show that a link has become slow
_SHARE_OF_BLOCK = 0.5  # a sample that takes longer makes a violation wait for longer than a block


class Task:
    """What a reader and the polling thread share: waveforms to play, blocks that were read.

    With each block comes whether it is the last one of its waveform. `judged` is set as long as the reader waits for
    a block: it has done with the last one.

    Args:
        poll: what the polling thread does with it, once that is started.
    """

    def __init__(self, poll: Callable[[Task], None]) -> None:
        self.todo: SimpleQueue[Waveform | None] = system.queue()
        self.done: SimpleQueue[tuple[Block, bool] | BaseException | None] = system.queue()
        self.pace = Pace()
        self.judged, self.stop = Flag(), Flag()
        self.thread = system.thread(poll, self, name="hil-poll")

    def next(self) -> Waveform | None:
        """The next waveform, None at the end.

        Raises:
            OutputUnderflowError: the program brings none.
        """
        waited_s = 0.0
        while not self.stop.is_set():
            with suppress(Empty):
                return self.todo.get(timeout=0.05)
            waited_s += 0.05
            if waited_s >= BEHIND_S:
                raise OutputUnderflowError(f"no sample to drive for {BEHIND_S:g} s; outputs stand at their last values")
        return None

    def end(self) -> None:
        """Stop, and wait for the sample that is under way."""
        self.stop.set()
        self.judged.set()
        if not system.is_this_thread(self.thread) and self.thread.is_alive():
            self.thread.join()


class Pace:
    """How a task keeps its time: when a block is over, and whether samples are still fast enough for it."""

    def __init__(self) -> None:
        self._block_s = self._longest_s = 0.0
        self._slow: list[tuple[float, float]] = []

    def planned(self, block_s: float, interval_s: float) -> None:
        """A block is planned to last so long, with a sample in each interval; shorter ones do not count."""
        self._block_s = max(self._block_s, block_s)
        self._longest_s = max(_SHARE_OF_BLOCK * self._block_s, interval_s)

    def is_over(self, begun_s: float | None, now_s: float) -> bool:
        """Whether a block that was begun at a time has lasted long enough."""
        return begun_s is not None and now_s - begun_s >= self._block_s

    def took(self, begun_s: float, ended_s: float) -> None:
        """One sample took from then to then."""
        if ended_s - begun_s > self._longest_s:
            self._slow.append((begun_s, ended_s))
        else:
            self._slow.clear()

    def check(self) -> None:
        """Raise `LinkError` when no sample has been fast enough for too long."""
        if len(self._slow) >= _FEWEST_SLOW and self._slow[-1][1] - self._slow[0][0] > BEHIND_S:
            took_s = float(np.median([ended_s - begun_s for begun_s, ended_s in self._slow]))
            raise LinkError(
                f"the link has become too slow: a sample takes {took_s:.3g} s, and may take {self._longest_s:.3g} s "
                f"where inputs are judged each {self._block_s:.3g} s"
            )


class Taken:
    """Samples as they come, to become a block."""

    def __init__(self, outputs: Iterable[str], inputs: Iterable[str], delays: Iterable[str]) -> None:
        self.late = 0
        self.invalid_reasons: dict[str, str] = {}
        self.begun_s: float | None = None
        self.time_s: list[float] = []
        self._columns: tuple[dict[str, list[float]], ...] = tuple(
            {name: [] for name in names} for names in (outputs, inputs, delays)
        )

    def add(self, begun_s: float, time_s: float, *rows: Mapping[str, float]) -> None:
        """One sample: when it was begun by the clock, its stamp, outputs, inputs, delays."""
        if self.begun_s is None:
            self.begun_s = begun_s
        self.time_s.append(time_s)
        for columns, row in zip(self._columns, rows, strict=True):
            for name, values in columns.items():
                values.append(row[name])

    def block(self) -> Block:
        """What came so far."""
        outputs, inputs, delays_s = (
            {name: np.array(values) for name, values in columns.items()} for columns in self._columns
        )
        return Block(np.array(self.time_s), inputs, outputs, self.late, delays_s, self.invalid_reasons)
