"""Counter outputs of NI devices as PWM: pulses of a fixed frequency, their duty cycle given sample by sample.

As the manuals of NI's X Series tell: in sample-clocked pulse generation a counter first makes the pulses with which
its channel was created, and from each edge of the sample clock on those of the next sample, beginning with a whole
pulse. A counter whose task is closed stands still at its idle level. Series without this (M Series, so also the
USB-6211) refuse.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil.daq.channel import OutputChannel
from hil.record.recording import Array

_SHORTEST_S = 1e-7  # a pulse, or a pause between two; a counter makes neither 0 nor 100 %


@dataclass(frozen=True, slots=True)
class Counters:
    """The counters of a device that are in use, by channel, each with a task of its own.

    Attributes:
        device: as NI MAX names it.
        pulses_hz: their frequency.
    """

    device: str
    pulses_hz: float
    channels: Mapping[str, OutputChannel]

    def held(self, levels: Mapping[str, float]) -> Iterator[Any]:
        """Tasks, started, that keep up these duty cycles [%] until they are closed; at 0 % there is none."""
        from nidaqmx.constants import AcquisitionType

        for name in self.channels:
            if levels[name] > 0.0:
                task = self._created(name, levels[name])
                yield task  # handed over first, so that it is closed if it cannot be started
                task.timing.cfg_implicit_timing(sample_mode=AcquisitionType.CONTINUOUS)
                task.start()

    def clocked(
        self, levels: Mapping[str, float], rate_hz: float, mode: Any, samples: int
    ) -> Iterator[tuple[str, Any]]:
        """By channel, tasks on the clock of the inputs, not started; until the first sample they keep up `levels`."""
        for name in self.channels:
            task = self._created(name, levels[name])
            yield name, task
            task.timing.cfg_samp_clk_timing(
                rate_hz, source=f"/{self.device}/ai/SampleClock", sample_mode=mode, samps_per_chan=samples
            )

    def samples(self, levels: Array) -> Any:
        """Duty cycles [%] as a task of nidaqmx takes them: one by itself, more in a list."""
        from nidaqmx.types import CtrFreq

        pulses = [CtrFreq(self.pulses_hz, duty) for duty in self._duty(levels).tolist()]
        return pulses if len(pulses) > 1 else pulses[0]

    def _created(self, name: str, level: float) -> Any:
        import nidaqmx
        from nidaqmx.constants import Level

        task = nidaqmx.Task()
        task.co_channels.add_co_pulse_chan_freq(
            f"{self.device}/{self.channels[name].terminal}", idle_state=Level.LOW, freq=self.pulses_hz,
            duty_cycle=float(self._duty(np.array([level]))[0]),
        )  # fmt: skip
        return task

    def _duty(self, levels: Array) -> Array:
        shortest = _SHORTEST_S * self.pulses_hz
        return np.clip(levels / 100.0, shortest, 1.0 - shortest)
