"""Voltage outputs of NI devices: on tasks of their clock, at once, and where they stand."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from drivers._ni_errors import NO_SUCH_CHANNEL
from hil.daq.channel import OutputChannel


@dataclass(frozen=True, slots=True)
class Voltages:
    """The voltage outputs of a device that are in use.

    Attributes:
        device: as NI MAX names it.
        outputs: by name of the channel.
    """

    device: str
    outputs: Mapping[str, OutputChannel]

    def add_to(self, task: Any) -> None:
        """Every one of them on a task, each with its range: NI's own default is another."""
        for channel in self.outputs.values():
            task.ao_channels.add_ao_voltage_chan(
                f"{self.device}/{channel.terminal}", min_val=channel.low, max_val=channel.high
            )

    def drive(self, values: Mapping[str, float]) -> None:
        """Write a value to each, at once."""
        import nidaqmx

        if not self.outputs:
            return
        with nidaqmx.Task() as task:
            self.add_to(task)
            written = [values[name] for name in self.outputs]
            task.write(written if len(written) > 1 else written[0], auto_start=True)

    def standing(self) -> dict[str, float]:
        """Where they stand, within their ranges; NaN where the device cannot be asked."""
        return {n: min(max(at, self.outputs[n].low), self.outputs[n].high) for n, at in self.measured().items()}

    def measured(self) -> dict[str, float]:
        """What is at their terminals, over the device's internal connections to its inputs; NaN where it has none."""
        return {name: self._measured(channel) for name, channel in self.outputs.items()}

    def _measured(self, channel: OutputChannel) -> float:
        import nidaqmx
        from nidaqmx.errors import DaqError

        try:
            with nidaqmx.Task() as task:
                task.ai_channels.add_ai_voltage_chan(
                    f"{self.device}/_{channel.terminal}_vs_aognd", min_val=-10.0, max_val=10.0
                )
                return float(task.read())
        except DaqError as error:
            if error.error_code != NO_SUCH_CHANNEL:
                raise
            return math.nan
