"""A board of NI behind an imitation of the package `nidaqmx`; imports nothing of this project.

It follows what NI documents (defaults, shapes, codes, triggers, non-regeneration, reservation); no device was there.
Tests put `Task` and `Device` in the place of those of nidaqmx; programs that they start find the package
`tests/stand_in/nidaqmx` on PYTHONPATH, whose board lies in a file, so that several processes have the same one.
"""

from __future__ import annotations

import fcntl
import json
import time
from pathlib import Path
from types import SimpleNamespace
from typing import IO, Any, Self

import numpy as np
from nidaqmx.constants import AcquisitionType, Level, RegenerationMode, TerminalConfiguration
from nidaqmx.errors import DaqError

PAIRED = [n for n in range(16) if n < 8]


class Board:
    """The device: what stands at its outputs, wired back to its inputs, and every call in order.

    Attributes:
        levels: by physical channel, without the device's name.
        pairs: the inputs that can be the first of a pair; with `inputs` those that it has.
        codes: by call, the code with which the next one fails.
        gone: the code with which every call fails.
        rates_of: the clock of which the sample rates are whole divisions.
        internal: whether outputs are connected to the inputs within the device.
    """

    def __init__(self) -> None:
        self.levels = {"ao0": 3.0, "ao1": 4.0, "ctr0": 0.0}
        self.levels |= {f"port{port}/line{line}": 0.0 for port in range(2) for line in range(4)}
        self.inputs, self.pairs = list(range(16)), PAIRED
        self.calls: list[str] = []
        self.playing: Task | None = None
        self.counting: Task | None = None
        self.pulses_hz: set[float] = set()
        self.codes: dict[str, int] = {}
        self.gone: int | None = None
        self.text = "the reason.\nDevice: Dev1\n\nTask Name: _unnamedTask<0>\n\nStatus Code: -1"
        self.rates_of = 20e6
        self.output_hz: float | None = None
        self.internal = True
        self.open = 0

    def fail(self, call: str) -> None:
        """Fail where a test says so."""
        if self.gone is not None:
            raise DaqError(self.text, self.gone)
        if call in self.codes:
            raise DaqError(self.text, self.codes.pop(call))

    def reserve(self, _what: str) -> None:
        """Taken by a task that is started; here there is one program."""

    def keep(self) -> None:
        """Outputs have changed."""

    def wait(self, _samples: int, _rate_hz: float) -> None:
        """Until so many samples were taken; here time does not matter."""

    def read(self, terminal: str) -> float:
        """What an input reads: an output of the same number."""
        return self.levels[f"ao{terminal[-1]}"]


class BoardInFile(Board):
    """A board that several processes have: a USB-6211 with an HPV41 and an SCQ-150, in real time.

    Its file says where the outputs stand; while there is another beside it that ends in `.unplugged`, nothing works.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path
        self._locks: dict[str, IO[str]] = {}
        self._next_s = 0.0
        self._samples = 0
        if path.exists():
            self.levels = self._said()

    def fail(self, call: str) -> None:
        """Unplugged, nothing works; else other processes may have switched something meanwhile."""
        if self._path.with_suffix(".unplugged").exists():
            raise DaqError("Device identifier is invalid.", -200324)
        if call == "create" and self._path.exists():
            self.levels = self._said()

    def reserve(self, what: str) -> None:
        """One process at a time has the voltage outputs."""
        if what in self._locks:
            return
        lock = self._path.with_suffix(f".{what}").open("w")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            lock.close()
            raise DaqError("The specified resource is reserved.", -50103) from None
        self._locks[what] = lock
        self._next_s = time.monotonic()

    def release(self) -> None:
        """The last task was closed."""
        while self._locks:
            self._locks.popitem()[1].close()

    def keep(self) -> None:
        """Write where the outputs stand, whole or not at all."""
        part = self._path.with_suffix(".part")
        part.write_text(json.dumps({"levels": self.levels}), encoding="utf-8")
        part.replace(self._path)

    def wait(self, samples: int, rate_hz: float) -> None:
        """In real time."""
        self._next_s += samples / rate_hz
        time.sleep(max(0.0, self._next_s - time.monotonic()))

    def read(self, terminal: str) -> float:
        """The flow meter on ai0: 70 l/min at 10 V while the relay is on, 50 l/min per volt, and a little noise."""
        self._samples += 1
        flow = 7.0 * self.levels["ao0"] * self.levels["port1/line0"] if terminal == "ai0" else 0.0
        return flow / 50.0 + 1e-3 * (self._samples % 7 - 3)

    def _said(self) -> dict[str, float]:
        said: dict[str, float] = json.loads(self._path.read_text(encoding="utf-8"))["levels"]
        return said


class Device:
    """A device as `nidaqmx.system.Device` documents it: which inputs it has in which wiring."""

    board: Board

    def __init__(self, name: str) -> None:
        self.name = name

    @property
    def ai_physical_chans(self) -> list[Any]:
        has = TerminalConfiguration
        self.board.fail("ask")
        return [
            SimpleNamespace(
                name=f"{self.name}/ai{n}",
                ai_term_cfgs=[has.RSE, has.NRSE, *([has.DIFF] if n in self.board.pairs else [])],
            )
            for n in self.board.inputs
        ]


class Task:
    """A task as `nidaqmx.Task` documents it."""

    board: Board

    def __init__(self) -> None:
        self.board.fail("create")
        self.channels: list[str] = []
        self.kwargs: list[dict[str, Any]] = []
        self.ai_channels = self.ao_channels = self.co_channels = self.do_channels = self.di_channels = self
        self.timing = self.triggers = self.start_trigger = self.out_stream = self
        self.regen_mode = RegenerationMode.ALLOW_REGENERATION
        self.samp_clk_rate, self.mode, self.size = 0.0, None, 0
        self.ai_conv_rate = 0.0
        self.buffer, self.done, self.triggered, self.started = np.empty((0, 0)), 0, "", False
        self.created = 0.0
        self.board.open += 1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def add_ai_voltage_chan(self, channel: str, **kwargs: Any) -> None:
        """An input, or a connection within the device."""
        if "_vs_aognd" in channel and not self.board.internal:
            raise DaqError("Physical channel specified does not exist on this device.\nDevice: Dev1", -200170)
        self.channels.append(channel.partition("/")[2])
        self.kwargs.append(kwargs)

    def add_ao_voltage_chan(self, channel: str, **kwargs: Any) -> None:
        """An output."""
        assert channel.partition("/")[2] in self.board.levels
        self.channels.append(channel.partition("/")[2])
        self.kwargs.append(kwargs)

    def add_do_chan(self, line: str) -> None:
        """A digital line."""
        assert line.partition("/")[2] in self.board.levels
        self.channels.append(line.partition("/")[2])

    add_di_chan = add_do_chan

    def add_co_pulse_chan_freq(self, counter: str, *, idle_state: Level, freq: float, duty_cycle: float) -> None:
        """Pulses of a counter."""
        assert idle_state is Level.LOW and 0.0 < duty_cycle < 1.0
        self.channels.append(counter.partition("/")[2])
        self.created = duty_cycle
        self.board.pulses_hz.add(freq)

    def cfg_implicit_timing(self, *, sample_mode: Any) -> None:
        """Without a clock."""
        assert self.is_counter and sample_mode is AcquisitionType.CONTINUOUS

    def cfg_samp_clk_timing(self, rate: float, *, source: str = "", sample_mode: Any, samps_per_chan: int) -> None:
        """On a clock; the rate is coerced to a whole division of that of the board."""
        assert samps_per_chan >= 2 and (source == "/Dev1/ai/SampleClock") == self.is_counter
        made_hz = self.board.rates_of / max(1, round(self.board.rates_of / rate))
        is_output = self.channels[0].startswith("ao")
        self.samp_clk_rate = self.board.output_hz if is_output and self.board.output_hz else made_hz
        self.mode, self.size = sample_mode, samps_per_chan

    def cfg_dig_edge_start_trig(self, source: str) -> None:
        """Started by another task."""
        self.triggered = source

    @property
    def is_counter(self) -> bool:
        """Whether it makes pulses."""
        return self.channels[0].startswith("ctr")

    def write(self, data: Any, auto_start: bool, timeout: float = 10.0) -> None:
        """Values at once, or samples into the buffer."""
        self.board.fail("write")
        if self.is_counter:
            pulses = data if isinstance(data, list) else [data]
            self.board.pulses_hz.update(pulse.freq for pulse in pulses)
            data = [pulse.duty_cycle for pulse in pulses]
        rows = np.atleast_2d(np.asarray(data, dtype=float))
        if auto_start:
            self._write_now(rows if rows.shape[0] == len(self.channels) else rows.T, isinstance(data, bool))
            return
        if self.done > self.buffer.shape[1]:
            raise DaqError("no new samples", -200290)
        self.buffer = np.hstack([self.buffer.reshape(len(self.channels), -1), rows])

    def _write_now(self, rows: Any, is_line: bool) -> None:
        assert is_line == self.channels[0].startswith("port")
        self.board.reserve("lines" if is_line else "ao")
        self.board.calls.append(f"write {self.channels[0] if is_line else ''} {[float(v) for v in rows[:, -1]]}")
        for channel, row in zip(self.channels, rows, strict=True):
            self.board.levels[channel] = float(row[-1])
        self.board.keep()

    def start(self) -> None:
        """Run, or wait for the trigger."""
        self.board.fail("start")
        self.started = True
        if self.is_counter:
            self.board.calls.append("start counter")
            self.board.counting = self
            self.board.levels["ctr0"] = self.created
        elif self.triggered:
            self.board.reserve("ao")
            self.board.calls.append("start outputs")
            self.board.playing = self
        else:
            self.board.reserve("ai")
            self.board.calls.append("start inputs")

    def read(self, number_of_samples_per_channel: int | None = None, timeout: float = 10.0) -> Any:
        """One value now, or so many samples."""
        self.board.fail("read")
        if number_of_samples_per_channel is None:
            return self._read_now()
        assert self.started
        count, playing = number_of_samples_per_channel, self.board.playing
        self.board.wait(count, self.samp_clk_rate)
        self.board.fail("read")
        read = np.empty((len(self.channels), count))
        for k in range(count):
            for row, channel in zip(read, self.channels, strict=True):
                row[k] = 0.0 if channel.startswith("_") else self.board.read(channel)
            if playing is not None and playing.done < playing.buffer.shape[1]:
                for channel, value in zip(playing.channels, playing.buffer[:, playing.done], strict=True):
                    self.board.levels[channel] = float(value)
            if playing is not None:
                playing.done += 1
            self.count()
        self.board.keep()
        return read.tolist() if len(read) > 1 else read[0].tolist()

    def _read_now(self) -> float | bool:
        (channel,) = self.channels
        if channel.startswith("port"):
            return bool(self.board.levels[channel])
        return self.board.levels[channel.removeprefix("_").removesuffix("_vs_aognd")]

    def count(self) -> None:
        """An edge of the sample clock at the counter."""
        counting = self.board.counting
        if counting is not None and counting.done < counting.buffer.shape[1]:
            self.board.levels["ctr0"] = float(counting.buffer[0, counting.done])
            counting.done += 1

    def stop(self) -> None:
        """End; outputs hold, a counter stands still."""
        self.started = False
        if self.board.counting is self:
            self.board.counting, self.board.levels["ctr0"] = None, 0.0
        if self.board.playing is self:
            self.board.playing = None

    def close(self) -> None:
        """Let go of what it took."""
        self.stop()
        self.board.open -= 1
        if self.board.open == 0 and isinstance(self.board, BoardInFile):
            self.board.release()


def plugged_in(monkeypatch: Any) -> Board:
    """A board of which `nidaqmx` knows for the rest of a test."""
    board = Board()
    for kind in (Task, Device):
        monkeypatch.setattr(kind, "board", board, raising=False)
    monkeypatch.setattr("nidaqmx.Task", Task)
    monkeypatch.setattr("nidaqmx.system.Device", Device)
    return board
