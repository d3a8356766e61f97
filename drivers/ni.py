"""NI multi-function DAQ through NI-DAQmx: outputs, inputs and PWM counters on one clock. Not run on hardware yet."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, NonNegativeInt, PositiveFloat, PositiveInt

from drivers._ni_counters import Counters
from hil.daq.channel import InputChannel, OutputChannel, Terminal, Wiring
from hil.daq.check import check_waveform, checked_task, coerced_rate
from hil.daq.contract import Block, Promises, Waveform
from hil.errors import (
    DeviceLostError,
    HardwareError,
    LinkError,
    OutputUnderflowError,
    OverrunError,
    SettingError,
)
from hil.record.recording import Array

_CLOCK_HZ = 20e6  # sample clocks are divided from it
_WAIT_S = 2.0  # beyond the time that samples take
_LEAST = 2  # samples of a buffered task
_KINDS: Mapping[int, type[HardwareError]] = {
    -200284: LinkError, -200474: LinkError, -200560: LinkError,  # nothing in time
    -200279: OverrunError, -200361: OverrunError,  # overwritten in the buffer, in the FIFO
    -200018: OutputUnderflowError, -200290: OutputUnderflowError, -200621: OutputUnderflowError,
    -200045: DeviceLostError, -200324: DeviceLostError, -200220: DeviceLostError, -50808: DeviceLostError,
}  # fmt: skip


class Settings(BaseModel):
    """What `[devices.NAME]` may say.

    Attributes:
        device: as NI MAX names it.
        outputs, inputs: how many the device has.
        counters: how many of its counters may be PWM outputs; they must know sample-clocked pulses (X Series).
        pwm_hz: frequency of their pulses.
        wiring: of the inputs: against ground, against AI SENSE, or in pairs.
        skew_s: from one input to the next; the driver sets the convert clock so.
        highest_rate_hz: of the outputs.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    device: str = "Dev1"
    outputs: PositiveInt = 2
    inputs: PositiveInt = 16
    counters: NonNegativeInt = 0
    pwm_hz: PositiveFloat = Field(default=1000.0, le=20_000.0)
    wiring: Literal["rse", "nrse", "diff"] = "diff"
    skew_s: PositiveFloat = Field(default=14e-6, ge=1e-7)
    highest_rate_hz: PositiveFloat = 250_000.0


def faults(settings: Settings) -> Iterator[tuple[tuple[str, ...], str]]:
    """What is wrong beyond the types."""
    if settings.wiring == "diff" and settings.inputs % 2:
        yield ("inputs",), f"{settings.inputs} inputs are no pairs; say how many there are one by one"


def terminals(settings: Settings) -> dict[str, Terminal]:
    """Outputs and inputs of ±10 V, in pairs half as many inputs; counters as duty cycles."""
    inputs = settings.inputs // 2 if settings.wiring == "diff" else settings.inputs
    return {
        **{f"ao{i}": Terminal("out", "voltage", "V", -10.0, 10.0) for i in range(settings.outputs)},
        **{f"ctr{i}": Terminal("out", "value", "%", 0.0, 100.0) for i in range(settings.counters)},
        **{f"ai{i}": Terminal("in", "voltage", "V", -10.0, 10.0) for i in range(inputs)},
    }


def open_daq(settings: Settings, wiring: Wiring) -> NiDaq:
    """The device, its outputs where they are found."""
    return NiDaq(settings, wiring)


class NiDaq:
    """A device on NI-DAQmx (see `hil.daq.contract.Daq`).

    The outputs start on the trigger of the inputs and use the same clock: an input that is read with sample k still
    shows what was driven before it. Outputs hold their value when a task ends, and when the program dies: the device
    has no watchdog. A counter is started anew between tasks, without pulses for a moment, and stands still (0 %) once
    the device is let go of, or a task is left early.

    Raises:
        DeviceLostError: no such device, or NI-DAQmx is not installed.
        LinkError: no input is in use; they start the outputs.
        SettingError: a counter whose safe value is not 0 %.
    """

    def __init__(self, settings: Settings, wiring: Wiring) -> None:
        if not wiring.inputs:
            raise LinkError(f"{settings.device}: at least one input must be in use; its trigger starts the outputs")
        _check_counters(wiring.outputs)
        self.outputs: Mapping[str, OutputChannel] = wiring.outputs
        self._analogue = {n: c for n, c in wiring.outputs.items() if not _is_counter(c)}
        counted = {n: c for n, c in wiring.outputs.items() if _is_counter(c)}
        self._counters = Counters(settings.device, settings.pwm_hz, counted)
        self.inputs: Mapping[str, InputChannel] = wiring.inputs
        count = len(wiring.inputs)
        scan_hz = 1.0 / (count * settings.skew_s)
        self.promises = Promises(
            timing="hardware", simultaneous=count == 1, skew_s=settings.skew_s if count > 1 else 0.0, read_at=0.0,
            holds_on_stop=True, lowest_rate_hz=1.0, highest_rate_hz=min(settings.highest_rate_hz, scan_hz),
            clock_hz=_CLOCK_HZ,
        )  # fmt: skip
        self._settings = settings
        self._tasks: list[Any] = []
        self._closed = False
        self._zero_s = time.monotonic()
        self._after_s = 0.0
        with _told(settings.device):
            self.levels: Mapping[str, float] = {
                name: min(max(self._found(c), c.low), c.high) for name, c in self.outputs.items()
            }

    def actual_rate_hz(self, asked_hz: float) -> float:
        """The nearest whole division of the device's clock."""
        return coerced_rate(self.promises, asked_hz)

    def play(self, waveform: Waveform, block_samples: int | None = None) -> Iterator[Block]:
        """Finite acquisition; the whole waveform is in the buffer before the first sample."""
        check_waveform(waveform, self.outputs, self.promises)
        return self._finite(waveform, block_samples or len(waveform))

    def stream(self, waveforms: Iterable[Waveform]) -> Iterator[Block]:
        """Continuous acquisition without regeneration; a program that comes too late meets an underflow."""
        return self._continuous(checked_task(waveforms, self.outputs, self.promises))

    def make_safe(self) -> None:
        """Stop what plays, and write every safe value at once."""
        self._end_tasks()
        if self._closed or not self.outputs:
            return
        import nidaqmx

        if self._analogue:
            with _told(self._settings.device, self.levels), nidaqmx.Task() as task:
                self._add_outputs(task)
                values = [channel.safe for channel in self._analogue.values()]
                task.write(values if len(values) > 1 else values[0], auto_start=True)
        self.levels = {name: channel.safe for name, channel in self.outputs.items()}

    def close(self) -> None:
        """Make safe and let go of the device."""
        if not self._closed:
            try:
                self.make_safe()
            finally:
                self._closed = True

    def _finite(self, waveform: Waveform, block_samples: int) -> Iterator[Block]:
        from nidaqmx.constants import AcquisitionType

        outputs = self._whole(waveform)
        samples = max(_LEAST, len(waveform))
        with self._task(waveform.rate_hz, AcquisitionType.FINITE, samples) as (writers, reading):
            start_s = self._started(writers, reading, outputs, samples)
            for first in range(0, len(waveform), block_samples):
                count = min(block_samples, len(waveform) - first)
                yield self._block(reading, outputs, first, count, start_s, waveform.rate_hz)
            if samples > len(waveform):
                self._read(reading, samples - len(waveform), waveform.rate_hz)

    def _continuous(self, waveforms: Iterator[Waveform]) -> Iterator[Block]:
        from nidaqmx.constants import AcquisitionType, RegenerationMode

        playing, failure = _next(waveforms)
        if playing is None:
            if failure is not None:
                raise failure
            return
        rate_hz, first = playing.rate_hz, 0
        with self._task(rate_hz, AcquisitionType.CONTINUOUS, max(_LEAST, 8 * len(playing))) as (writers, reading):
            for writer in writers:
                writer.task.out_stream.regen_mode = RegenerationMode.DONT_ALLOW_REGENERATION
            outputs = self._whole(playing)
            following, failure = _next(waveforms)
            ahead = self._after(outputs, following, rate_hz)
            both = {name: np.concatenate((values, ahead[name])) for name, values in outputs.items()}
            start_s = self._started(writers, reading, both, len(next(iter(both.values()), np.empty(0))))
            while True:
                yield self._block(reading, outputs, 0, len(playing), start_s + first / rate_hz, rate_hz)
                first += len(playing)
                if following is None:
                    break
                playing, outputs = following, ahead
                following, failure = _next(waveforms)
                ahead = self._after(outputs, following, rate_hz)
                self._write(writers, ahead, start=False)
        if failure is not None:
            raise failure

    def _after(self, outputs: Mapping[str, Array], following: Waveform | None, rate_hz: float) -> dict[str, Array]:
        """What is in the buffer behind a waveform: the next one, or the last value until the task is stopped."""
        last = {name: float(values[-1]) for name, values in outputs.items()}
        if following is None:
            return {name: np.full(max(_LEAST, round(rate_hz)), value) for name, value in last.items()}
        return self._whole(following, last)

    def _whole(self, waveform: Waveform, levels: Mapping[str, float] | None = None) -> dict[str, Array]:
        """Every output over a waveform; those that it does not name stand."""
        standing = self.levels if levels is None else levels
        return {name: np.asarray(waveform.outputs.get(name, np.full(len(waveform), standing[name])), dtype=np.float64)
                for name in self.outputs}  # fmt: skip

    @contextmanager
    def _task(self, rate_hz: float, mode: Any, samples: int) -> Iterator[tuple[list[_Writer], Any]]:
        """The tasks of outputs and of inputs, on one clock, not started; afterwards counters keep up their level."""
        import nidaqmx

        self._end_tasks()
        try:
            with _told(self._settings.device, self.levels):
                reading = nidaqmx.Task()
                self._tasks.append(reading)
                for channel in self.inputs.values():
                    reading.ai_channels.add_ai_voltage_chan(
                        f"{self._settings.device}/{channel.terminal}", terminal_config=self._configuration(),
                        min_val=channel.low, max_val=channel.high,
                    )  # fmt: skip
                reading.timing.cfg_samp_clk_timing(rate_hz, sample_mode=mode, samps_per_chan=samples)
                if len(self.inputs) > 1:
                    reading.timing.ai_conv_rate = 1.0 / self._settings.skew_s
                self._check_rate(reading, rate_hz)
                writers = [*self._analogue_writers(rate_hz, mode, samples), *self._pwm_writers(rate_hz, mode, samples)]
            yield writers, reading
        finally:
            self._end_tasks()
            held = self.levels
            self.levels = {**held, **dict.fromkeys(self._counters.channels, 0.0)}
        with _told(self._settings.device, self.levels):
            for task in self._counters.held(held):
                self._tasks.append(task)
        self.levels = held

    def _analogue_writers(self, rate_hz: float, mode: Any, samples: int) -> Iterator[_Writer]:
        import nidaqmx

        if not self._analogue:
            return
        writing = nidaqmx.Task()
        self._tasks.append(writing)
        self._add_outputs(writing)
        writing.timing.cfg_samp_clk_timing(rate_hz, sample_mode=mode, samps_per_chan=samples)
        writing.triggers.start_trigger.cfg_dig_edge_start_trig(f"/{self._settings.device}/ai/StartTrigger")
        self._check_rate(writing, rate_hz)
        yield _Writer(writing, tuple(self._analogue), _voltages)

    def _pwm_writers(self, rate_hz: float, mode: Any, samples: int) -> Iterator[_Writer]:
        for name, task in self._counters.clocked(self.levels, rate_hz, mode, samples):
            self._tasks.append(task)
            yield _Writer(task, (name,), lambda rows: self._counters.samples(rows[0]))

    def _add_outputs(self, task: Any) -> None:
        for channel in self._analogue.values():
            task.ao_channels.add_ao_voltage_chan(
                f"{self._settings.device}/{channel.terminal}", min_val=channel.low, max_val=channel.high
            )

    def _check_rate(self, task: Any, rate_hz: float) -> None:
        real_hz = float(task.timing.samp_clk_rate)
        if abs(real_hz - rate_hz) > 1e-6 * rate_hz:
            raise LinkError(f"{self._settings.device} uses {real_hz:g} Hz where {rate_hz:g} Hz were asked for")

    def _configuration(self) -> Any:
        from nidaqmx.constants import TerminalConfiguration as Has

        return {"rse": Has.RSE, "nrse": Has.NRSE, "diff": Has.DIFF}[self._settings.wiring]

    def _started(self, writers: list[_Writer], reading: Any, outputs: Mapping[str, Array], samples: int) -> float:
        """Fill the buffers and start; the time of the first sample on the device's clock."""
        padded = {name: np.append(v, np.full(samples - len(v), v[-1])) for name, v in outputs.items()}
        self._write(writers, padded, start=True)
        with _told(self._settings.device, self.levels):
            reading.start()
        self._after_s = max(self._after_s, time.monotonic() - self._zero_s)
        return self._after_s

    def _write(self, writers: list[_Writer], outputs: Mapping[str, Array], start: bool) -> None:
        with _told(self._settings.device, self.levels):
            for writer in writers:
                writer.write(outputs)
                if start:
                    writer.task.start()

    def _block(
        self, reading: Any, outputs: Mapping[str, Array], first: int, count: int, start_s: float, rate_hz: float
    ) -> Block:
        rows = self._read(reading, count, rate_hz)
        time_s = start_s + (first + np.arange(count)) / rate_hz
        driven = {name: values[first : first + count] for name, values in outputs.items()}
        self.levels = {name: float(values[-1]) for name, values in driven.items()}
        self._after_s = float(time_s[-1]) + 1.0 / rate_hz
        clipped = {
            n: np.clip(row, self.inputs[n].low, self.inputs[n].high) for n, row in zip(self.inputs, rows, strict=True)
        }
        return Block(time_s, clipped, driven)

    def _read(self, reading: Any, count: int, rate_hz: float) -> Array:
        with _told(self._settings.device, self.levels):
            read = reading.read(number_of_samples_per_channel=count, timeout=count / rate_hz + _WAIT_S)
        return np.asarray(read, dtype=np.float64).reshape(len(self.inputs), count)

    def _found(self, channel: OutputChannel) -> float:
        """Where an output stands: voltages over the device's internal connection to its inputs; counters are still."""
        import nidaqmx

        if _is_counter(channel):
            return 0.0
        with nidaqmx.Task() as task:
            task.ai_channels.add_ai_voltage_chan(
                f"{self._settings.device}/_{channel.terminal}_vs_aognd", min_val=-10.0, max_val=10.0
            )
            return float(task.read())

    def _end_tasks(self) -> None:
        tasks, self._tasks = self._tasks, []
        for task in reversed(tasks):  # outputs first
            with suppress(Exception):  # a task that has failed says so again when it is stopped
                task.stop()
            with suppress(Exception):
                task.close()


@dataclass(frozen=True, slots=True)
class _Writer:
    """A task of outputs, the channels on it, and how it takes their rows of samples."""

    task: Any
    names: tuple[str, ...]
    packed: Callable[[list[Array]], Any]

    def write(self, outputs: Mapping[str, Array]) -> None:
        """Put samples into its buffer."""
        self.task.write(self.packed([outputs[name] for name in self.names]), auto_start=False, timeout=_WAIT_S)


def _voltages(rows: list[Array]) -> Array:
    return np.array(rows) if len(rows) > 1 else rows[0]


def _is_counter(channel: OutputChannel) -> bool:
    return channel.terminal.startswith("ctr")


def _check_counters(outputs: Mapping[str, OutputChannel]) -> None:
    for name, channel in outputs.items():
        if _is_counter(channel) and channel.safe != 0.0:
            raise SettingError(
                f"'{name}': safe = {channel.safe:g} %; {channel.terminal} stands still once the program lets go of it, "
                f"so only 0 % can be its safe value"
            )


@contextmanager
def _told(device: str, levels: Mapping[str, float] | None = None) -> Iterator[None]:
    """Errors of NI-DAQmx as those of `hil.errors`."""
    from nidaqmx.errors import DaqError, DaqNotFoundError

    try:
        yield
    except DaqNotFoundError as error:
        raise DeviceLostError("NI-DAQmx is not installed on this computer") from error
    except DaqError as error:
        kind = _KINDS.get(error.error_code, LinkError)
        standing = "".join(f"; {name} stood at {level:g}" for name, level in (levels or {}).items())
        stands = f"{standing}: use the emergency stop" if kind is DeviceLostError and standing else ""
        text = " ".join(str(error).split("\n")[0].split())
        raise kind(f"{device}: {text} ({error.error_code}){stands}") from error


def _next(waveforms: Iterator[Waveform]) -> tuple[Waveform | None, Exception | None]:
    """The next waveform, or why there is none; raised only after what has been read was handed over."""
    try:
        return next(waveforms, None), None
    except Exception as error:
        return None, error
