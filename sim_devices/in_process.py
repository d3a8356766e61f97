"""A 16-bit multi-function DAQ in this process, with a simulated plant behind its terminals."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import chain

import numpy as np

from hil.clock import Clock, VirtualClock, clock
from hil.daq.channel import InputChannel, OutputChannel, Wiring
from hil.daq.check import check_waveform, checked_task, coerced_rate, next_or_failure
from hil.daq.contract import Block, Promises, ReadBack, Waveform
from hil.errors import DeviceLostError, HardwareError, OutputUnderflowError, OverrunError
from sim_devices._converter import Converter
from sim_devices._settings import Fault, Settings, faults, terminals

__all__ = ["Settings", "faults", "open_daq", "terminals"]


def open_daq(settings: Settings, wiring: Wiring, by: Clock | None = None) -> SimulatedDaq:
    """The device, switched on; the plant has settled under its power-on outputs.

    Args:
        settings: of the device and its world.
        wiring: the channels in use; the simulation has an instrument for each.
        by: the clock that paces it, if not the one that `settings.time` asks for.
    """
    return SimulatedDaq(settings, wiring, by or clock(settings.time))


class SimulatedDaq:
    """A plant behind converters, a multiplexer and noise (see `hil.daq.contract.Daq`).

    Outputs change and the first input is read on one clock edge: that reading still shows what was driven
    before.
    """

    def __init__(self, settings: Settings, wiring: Wiring, by: Clock) -> None:
        self.outputs: Mapping[str, OutputChannel] = {
            name: replace(c, step=float(Converter.of(c.kind, c.low, c.high, settings.bits).lsb))
            for name, c in wiring.outputs.items()
        }
        self.inputs: Mapping[str, InputChannel] = {
            name: replace(c, step=float(Converter.of(c.kind, c.low, c.high, settings.bits, c.over).lsb))
            for name, c in wiring.inputs.items()
        }
        self.promises = _promises(settings, len(wiring.inputs))
        self.levels = {
            name: min(max(settings.power_on, channel.low), channel.high) for name, channel in wiring.outputs.items()
        }
        from sim_devices._rig import SimulatedRig  # a check of a bench file simulates nothing

        self._settings, self._clock = settings, by
        self._rig = SimulatedRig(settings, wiring, self.levels)
        self._zero_s = by.now_s - self.now_s
        self._samples = 0
        self._fault = settings.fault
        self._lost = False
        self._again = 0

    def actual_rate_hz(self, asked_hz: float) -> float:
        """The nearest whole division of the device's clock."""
        return coerced_rate(self.promises, asked_hz)

    def play(self, waveform: Waveform, block_samples: int | None = None) -> Iterator[Block]:
        """Finite acquisition; a reader who falls behind by more than the buffer meets an `OverrunError`."""
        check_waveform(waveform, self.outputs, self.promises)
        return self._task(waveform.slices(block_samples or len(waveform)), OverrunError)

    def stream(self, waveforms: Iterable[Waveform]) -> Iterator[Block]:
        """Continuous acquisition; a writer who falls behind by more than the buffer meets an `OutputUnderflowError`."""
        return self._task(checked_task(waveforms, self.outputs, self.promises), OutputUnderflowError)

    @property
    def roll_back(self) -> Callable[[int], None] | None:
        """In virtual time (see `hil.daq.contract.Daq`)."""
        return self._play_again if isinstance(self._clock, VirtualClock) else None

    def make_safe(self) -> None:
        """Put every output at its safe value.

        Raises:
            DeviceLostError: the device is gone; nobody reaches its outputs.
        """
        self._refuse_if_lost()
        self._catch_up()
        self.levels = {name: channel.safe for name, channel in self.outputs.items()}

    def read_back(self) -> Mapping[str, ReadBack]:
        """Where the outputs of the device stand, unless it is gone."""
        if self._lost:
            return dict.fromkeys(self.outputs, ReadBack(why="the simulated device is gone"))
        return {name: ReadBack(level) for name, level in self.levels.items()}

    def close(self) -> None:
        """Make safe; a device that is gone is let go of as it is."""
        if not self._lost:
            self.make_safe()

    @property
    def now_s(self) -> float:
        """The device's own time."""
        return self._rig.ticks / self._settings.clock_hz

    def _task(self, waveforms: Iterator[Waveform], too_late: type[HardwareError]) -> Iterator[Block]:
        self._refuse_if_lost()
        self._catch_up()
        waveform, failure = next_or_failure(waveforms)
        while waveform is not None:
            stood, played = self._checkpoint(), waveform
            block = self._run(waveform)
            fault = self._fault_in(len(waveform) - len(block))
            waveform, failure = next_or_failure(waveforms)  # asked for while this one plays
            self._clock.sleep_until(self._zero_s + self.now_s)
            if len(block):
                yield block
            if samples := self._again:
                stood()
                waveforms = chain(played.slices(samples), _rest(waveform, failure), waveforms)
                waveform, failure = next_or_failure(waveforms)
                continue
            if fault is not None:
                raise fault
            if waveform is not None:
                self._check_punctual(too_late)
        if failure is not None:
            raise failure

    def _play_again(self, block_samples: int) -> None:
        self._again = block_samples

    def _checkpoint(self) -> Callable[[], None]:
        """Keep how the device stands; what is returned takes it back there."""
        clock = self._clock
        if not isinstance(clock, VirtualClock):
            return lambda: None
        rig, now_s = self._rig.checkpoint(), clock.now_s
        levels, samples, fault, lost = self.levels, self._samples, self._fault, self._lost

        def roll_back() -> None:
            rig()
            clock.now_s, self._again = now_s, 0
            self.levels, self._samples, self._fault, self._lost = levels, samples, fault, lost

        return roll_back

    def _run(self, waveform: Waveform) -> Block:
        """Drive a waveform, or as much of it as the fault on demand lets through."""
        fault = self._fault
        samples = len(waveform) if fault is None else min(len(waveform), fault.after - self._samples)
        if not samples:
            return Block(np.empty(0), {}, {})
        outputs = {name: np.full(samples, level) for name, level in self.levels.items() if name not in waveform.outputs}
        outputs |= {name: values[:samples] for name, values in waveform.outputs.items()}
        every = round(self._settings.clock_hz / waveform.rate_hz)
        first, signals = self._rig.ticks, self._rig.run(outputs, samples, every)
        time_s = (first + every * np.arange(samples)) / self._settings.clock_hz
        inputs = self._rig.inputs.read(signals, self.promises.read_at * every, every, time_s)
        self.levels = {name: float(outputs[name][-1]) for name in self.outputs}
        self._samples += samples
        return Block(time_s, inputs, outputs)

    def _fault_in(self, missing: int) -> HardwareError | None:
        """The fault on demand, when it has cut off samples. It happens once; only a lost device stays lost."""
        if not missing or self._fault is None:
            return None
        fault, self._fault = self._fault, None
        self._lost = fault.kind == "lost"
        return _error(fault, self._samples)

    def _catch_up(self) -> None:
        """Let the time pass for which outputs have stood since the last task."""
        behind_s = self._clock.now_s - self._zero_s - self.now_s
        ticks = math.floor(behind_s * self._settings.clock_hz + 1e-6)
        if ticks > 0:
            self._rig.hold(self.levels, ticks)

    def _check_punctual(self, too_late: type[HardwareError]) -> None:
        late_s = self._clock.now_s - self._zero_s - self.now_s
        if late_s > self._settings.buffer_s:
            raise too_late(
                f"simulated device: the program is {late_s:.3g} s behind the sample clock; the buffer holds "
                f"{self._settings.buffer_s:g} s; outputs stand at their last values"
            )

    def _refuse_if_lost(self) -> None:
        if self._lost:
            raise _error(Fault(kind="lost", after=0), self._samples)


def _rest(waveform: Waveform | None, failure: Exception | None) -> Iterator[Waveform]:
    """What was asked for already, as it came."""
    if waveform is not None:
        yield waveform
    if failure is not None:
        raise failure


def _promises(settings: Settings, inputs: int) -> Promises:
    scan_hz = 1.0 / (inputs * settings.skew_s) if settings.skew_s and inputs else math.inf
    return Promises(
        timing="virtual" if settings.time == "virtual" else "hardware",
        simultaneous=settings.skew_s == 0.0, skew_s=settings.skew_s, read_at=0.0, holds_on_stop=True,
        lowest_rate_hz=settings.clock_hz / 1e6, highest_rate_hz=min(settings.clock_hz, scan_hz),
        clock_hz=settings.clock_hz,
    )  # fmt: skip


def _error(fault: Fault, samples: int) -> HardwareError:
    if fault.kind == "underflow":
        return OutputUnderflowError(f"simulated device: no sample to drive after {samples} samples")
    if fault.kind == "overrun":
        return OverrunError(f"simulated device: sample {samples} was overwritten before it was read")
    return DeviceLostError(f"simulated device: gone after {samples} samples")
