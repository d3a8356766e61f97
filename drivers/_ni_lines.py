"""Digital lines of NI devices: set and read by software, as the USB-6211 and its like have no clock for them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from drivers._ni_heartbeat import Heartbeat
from hil.daq.channel import InputChannel, OutputChannel
from hil.daq.contract import Waveform
from hil.errors import RangeError
from hil.record.recording import Array


@dataclass(frozen=True, slots=True)
class Lines:
    """The lines of a device that are in use.

    Attributes:
        device: as NI MAX names it.
        out_port, in_port: the ports on which they are.
        outputs, inputs: by name of the channel.
        beats: of the outputs, those that change again and again while they are on.
    """

    device: str
    out_port: int
    in_port: int
    outputs: Mapping[str, OutputChannel]
    inputs: Mapping[str, InputChannel]
    beats: Mapping[str, Heartbeat]

    def check(self) -> None:
        """Raise what ended a line that should change again and again, if something did."""
        for beat in self.beats.values():
            beat.check()

    def standing(self) -> dict[str, float]:
        """How the outputs stand, as the device tells; one that changes again and again is on."""
        import nidaqmx

        found = {name: 1.0 for name, beat in self.beats.items() if beat.beats}
        for name in self.outputs.keys() - found.keys():
            channel = self.outputs[name]
            with nidaqmx.Task() as task:
                task.do_channels.add_do_chan(self._line(self.out_port, channel.terminal))
                found[name] = float(task.read())
        return found

    def drive(self, values: Mapping[str, float]) -> None:
        """Switch outputs; they stay so when the task is closed."""
        import nidaqmx

        for name in self.outputs.keys() & values.keys():
            if name in self.beats:
                self.beats[name].end()
                if values[name] > 0.5:
                    self.beats[name].begin()
                    continue
            with nidaqmx.Task() as task:
                task.do_channels.add_do_chan(self._line(self.out_port, self.outputs[name].terminal))
                task.write(values[name] > 0.5, auto_start=True)

    def read(self) -> dict[str, float]:
        """Every input, read now."""
        import nidaqmx

        found = {}
        for name, channel in self.inputs.items():
            with nidaqmx.Task() as task:
                task.di_channels.add_di_chan(self._line(self.in_port, channel.terminal))
                found[name] = float(task.read())
        return found

    def steady(self, waveforms: Iterable[Waveform]) -> Iterator[Waveform]:
        """The waveforms, each refused if a line would have to change within it, or stand between on and off.

        Raises:
            RangeError: it would.
        """
        for waveform in waveforms:
            for name in self.outputs.keys() & waveform.outputs.keys():
                self._check(name, waveform.outputs[name])
            yield waveform

    def _check(self, name: str, values: Array) -> None:
        terminal = self.outputs[name].terminal
        if not np.isin(values, (0.0, 1.0)).all():
            raise RangeError(f"output '{name}': {terminal} of {self.device} is on (1) or off (0), nothing between")
        if (values != values[0]).any():
            raise RangeError(
                f"output '{name}': {terminal} of {self.device} is switched by software, so that it changes only "
                f"between two waveforms, never within one"
            )

    def _line(self, port: int, terminal: str) -> str:
        return f"{self.device}/port{port}/line{terminal[2:]}"
