"""A DAQ that is a piece of wire: every output is read back, and every value it ever had is remembered."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from hil.daq.channel import InputChannel, OutputChannel
from hil.daq.check import check_waveform, checked_task, coerced_rate
from hil.daq.contract import Block, Promises, ReadBack, Waveform


class Wire:
    """Outputs `a` and `b` of ±10, read back as `a read` and `b read` with an offset that a test may change.

    Attributes:
        log: by output, every value that it was given, with its sample rate; None for a jump to safe.
    """

    promises = Promises("virtual", True, 0.0, 0.0, True, 1.0, 10_000.0)

    def __init__(self, levels: Mapping[str, float] | None = None, safe: Mapping[str, float] | None = None) -> None:
        self.levels = {"a": 0.0, "b": 0.0, **(levels or {})}
        self.safe = {"a": 0.0, "b": 0.0, **(safe or {})}
        self.outputs = {
            name: OutputChannel(name, name, "voltage", "V", -10.0, 10.0, self.safe[name]) for name in self.levels
        }
        self.inputs = {
            f"{name} read": InputChannel(f"{name} read", name, "voltage", "V", -20.0, 20.0) for name in self.levels
        }
        self.log: dict[str, list[tuple[float, float | None]]] = {name: [] for name in self.levels}
        self.offset = 0.0
        self.time_s = 0.0
        self.closed = 0

    def actual_rate_hz(self, asked_hz: float) -> float:
        return coerced_rate(self.promises, asked_hz)

    def play(self, waveform: Waveform, block_samples: int | None = None) -> Iterator[Block]:
        check_waveform(waveform, self.outputs, self.promises)
        return map(self._run, waveform.slices(block_samples or len(waveform)))

    def stream(self, waveforms: Iterable[Waveform]) -> Iterator[Block]:
        return map(self._run, checked_task(waveforms, self.outputs, self.promises))

    def make_safe(self) -> None:
        for name, value in self.safe.items():
            if self.levels[name] != value:
                self.log[name].append((value, None))
        self.levels = dict(self.safe)

    def read_back(self) -> Mapping[str, ReadBack]:
        return {name: ReadBack(level) for name, level in self.levels.items()}

    def close(self) -> None:
        self.make_safe()
        self.closed += 1

    def _run(self, waveform: Waveform) -> Block:
        samples = len(waveform)
        values = {name: np.asarray(waveform.outputs.get(name, np.full(samples, level)), dtype=float)
                  for name, level in self.levels.items()}  # fmt: skip
        for name in waveform.outputs:
            self.log[name] += [(float(value), waveform.rate_hz) for value in values[name]]
        self.levels = {name: float(given[-1]) for name, given in values.items()}
        time_s = self.time_s + np.arange(samples) / waveform.rate_hz
        self.time_s += samples / waveform.rate_hz
        return Block(time_s, {f"{name} read": given + self.offset for name, given in values.items()}, values)
