"""NI multi-function DAQ through NI-DAQmx: voltages and PWM counters on one clock, lines. Not run on hardware yet."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from pydantic import Field, NonNegativeInt, PositiveFloat, PositiveInt

from drivers._ni_board import InputWiring, check_inputs, configuration, input_numbers
from drivers._ni_counters import Counters
from drivers._ni_errors import device_errors
from drivers._ni_heartbeat import Heartbeat
from drivers._ni_lines import Lines
from drivers._ni_voltages import Voltages
from hil.daq.channel import InputChannel, OutputChannel, Terminal, Wiring
from hil.daq.check import check_waveform, checked_task, coerced_rate, next_or_failure
from hil.daq.contract import CANNOT_BE_ASKED, Block, Promises, ReadBack, Waveform
from hil.daq.device_link import stands_as_driven
from hil.errors import DeviceLostError, HardwareError, LinkError, SettingError
from hil.record.recording import Array
from hil.strict import Strict
from hil.system import system

_OVER = 0.024  # M Series boards resolve their ranges with 5 % of over-range, half of it at either end
_WAIT_S = 2.0  # beyond the time that samples take
_LEAST = 2  # samples of a buffered task
_CLOSE = 0.1  # V, or of a line: what a board makes and measures of its own outputs differs by mV
_Channel = TypeVar("_Channel", OutputChannel, InputChannel)
_GROUND = "_aignd_vs_aignd"  # within the device: sampled for the sake of its clock when no input is in use


class Settings(Strict):
    """What `[devices.NAME]` may say.

    Attributes:
        device: as NI MAX names it.
        outputs, inputs: how many the device has, one by one.
        counters: how many of its counters may be PWM outputs; they must know sample-clocked pulses (X Series).
        pwm_hz: frequency of their pulses.
        wiring: of the inputs: against ground, against AI SENSE, in pairs, or each with a wire back of its own.
        skew_s: from one input to the next; the driver sets the convert clock so. 0: the device samples all at once.
        highest_rate_hz: of the outputs.
        digital_outputs, digital_inputs: how many lines are used as such.
        output_port, input_port: on which ports they are.
        heartbeat_s: a digital output may also be used as a heartbeat, which changes so often while it is on.
    """

    device: str = "Dev1"
    outputs: PositiveInt = 2
    inputs: PositiveInt = 16
    counters: NonNegativeInt = 0
    pwm_hz: PositiveFloat = Field(default=1000.0, le=20_000.0)
    wiring: InputWiring = "diff"
    skew_s: float = Field(default=14e-6, ge=0.0)
    highest_rate_hz: PositiveFloat = 250_000.0
    digital_outputs: int = Field(default=4, ge=0, le=32)
    digital_inputs: int = Field(default=4, ge=0, le=32)
    output_port: NonNegativeInt = 1
    input_port: NonNegativeInt = 0
    heartbeat_s: PositiveFloat | None = None


def faults(settings: Settings) -> Iterator[tuple[tuple[str, ...], str]]:
    """What is wrong beyond the types."""
    if settings.wiring == "diff" and settings.inputs % 2:
        yield ("inputs",), f"{settings.inputs} inputs are no pairs; say how many there are one by one"
    if 0.0 < settings.skew_s < 1e-7:
        yield ("skew_s",), f"{settings.skew_s:g} s is shorter than 100 ns; 0 says that all are sampled at once"
    if settings.output_port == settings.input_port and settings.digital_outputs and settings.digital_inputs:
        yield (
            ("input_port",),
            f"port {settings.input_port} has the outputs already; the other direction needs another port",
        )


def terminals(settings: Settings) -> dict[str, Terminal]:
    """Outputs and inputs of ±10 V, in pairs half as many inputs; counters as duty cycles; digital lines."""
    beats = settings.heartbeat_s is not None
    return {
        **{f"ao{i}": Terminal("out", "voltage", "V", -10.0, 10.0) for i in range(settings.outputs)},
        **{f"ctr{i}": Terminal("out", "value", "%", 0.0, 100.0) for i in range(settings.counters)},
        **{f"do{i}": Terminal("out", "digital", "1", 0.0, 1.0) for i in range(settings.digital_outputs)},
        **{f"hb{i}": Terminal("out", "digital", "1", 0.0, 1.0) for i in range(settings.digital_outputs * beats)},
        **{f"ai{i}": Terminal("in", "voltage", "V", -10.0, 10.0, over=_OVER)
           for i in input_numbers(settings.inputs, settings.wiring)},
        **{f"di{i}": Terminal("in", "digital", "1", 0.0, 1.0) for i in range(settings.digital_inputs)},
    }  # fmt: skip


def needs(_settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return ("nidaqmx",)


def open_daq(settings: Settings, wiring: Wiring) -> NiDaq:
    """The device, its outputs where they are found."""
    return NiDaq(settings, wiring)


class NiDaq:
    """A device on NI-DAQmx (see `hil.daq.contract.Daq`).

    The outputs start on the trigger of the inputs and use the same clock: an input that is read with sample k still
    shows what was driven before it. Where no input is in use, one within the device gives the clock. Outputs hold their
    value when a task ends, and when the program dies: the device has no watchdog. A counter is started anew between
    tasks, without pulses for a moment, and stands still (0 %) once the device is let go of, or a task is left early.
    Digital lines are switched between waveforms, and read once for each block: a reading is that of its last sample.

    Raises:
        DeviceLostError: no such device, or NI-DAQmx is not installed.
        SettingError: a counter whose safe value is not 0 %, an input that the device does not have in this wiring, or a
            line that is used twice.
    """

    def __init__(self, settings: Settings, wiring: Wiring) -> None:
        _check_counters(wiring.outputs)
        self.outputs: Mapping[str, OutputChannel] = wiring.outputs
        self._voltages = Voltages(settings.device, _of_kind(wiring.outputs, "ao"))
        self._counters = Counters(settings.device, settings.pwm_hz, _of_kind(wiring.outputs, "ctr"))
        self._lines = _lines_of(settings, wiring)
        self.inputs: Mapping[str, InputChannel] = wiring.inputs
        self._sampled = _of_kind(wiring.inputs, "ai")
        count = len(self._sampled)
        scan_hz = 1.0 / (count * settings.skew_s) if count * settings.skew_s else math.inf
        self.promises = Promises(
            timing="hardware", simultaneous=count <= 1 or not settings.skew_s,
            skew_s=settings.skew_s if count > 1 else 0.0, read_at=0.0, holds_on_stop=True, lowest_rate_hz=1.0,
            highest_rate_hz=min(settings.highest_rate_hz, scan_hz),
        )  # fmt: skip
        self._settings = settings
        self._tasks: list[Any] = []
        self._rates_hz: dict[float, float] = {}
        self._closed = False
        self._zero_s = system.now_s()
        self._after_s = 0.0
        self.levels: Mapping[str, float] = {}
        with self._device_errors():
            check_inputs(settings.device, settings.wiring, self._sampled)
            self.levels = {
                **dict.fromkeys(self._counters.channels, 0.0),
                **self._lines.standing(),
                **self._voltages.standing(),
            }
            self._known = self._lines.read()

    def actual_rate_hz(self, asked_hz: float) -> float:
        """The rate that the device makes of it, as it says itself: each kind divides another clock."""
        rate_hz = coerced_rate(self.promises, asked_hz)
        if rate_hz not in self._rates_hz:
            self._rates_hz[rate_hz] = self._made_of(rate_hz)
        return self._rates_hz[rate_hz]

    def play(self, waveform: Waveform, block_samples: int | None = None) -> Iterator[Block]:
        """Finite acquisition; the whole waveform is in the buffer before the first sample."""
        check_waveform(waveform, self.outputs, self.promises)
        (steady,) = self._lines.steady([waveform])
        return self._finite(steady, block_samples or len(waveform))

    def stream(self, waveforms: Iterable[Waveform]) -> Iterator[Block]:
        """Continuous acquisition without regeneration; a program that comes too late meets an underflow."""
        return self._continuous(self._lines.steady(checked_task(waveforms, self.outputs, self.promises)))

    def make_safe(self) -> None:
        """Stop what plays, and put every output at its safe value at once: digital lines first, then voltages.

        Raises:
            DeviceLostError: an output could not be reached.
        """
        self._end_tasks()
        if self._closed or not self.outputs:
            return
        self.levels = {**self.levels, **dict.fromkeys(self._counters.channels, 0.0)}  # without a task they stand still
        failures = [
            failure for group in (self._lines, self._voltages) if (failure := self._made_safe(group)) is not None
        ]
        if failures:
            raise DeviceLostError("; ".join(failures))

    def _made_safe(self, group: Lines | Voltages) -> str | None:
        """Drive outputs of one kind safe, whatever became of the others; why they could not be, or None."""
        safe = {name: channel.safe for name, channel in group.outputs.items()}
        try:
            with self._device_errors():
                group.drive(safe)
        except HardwareError as error:
            return str(error)
        self.levels = {**self.levels, **safe}
        return None

    def read_back(self) -> Mapping[str, ReadBack]:
        """Voltages over the device's connections within, lines as it has them; a counter cannot be asked."""
        found: dict[str, ReadBack] = dict.fromkeys(self._counters.channels, CANNOT_BE_ASKED)
        for group, asked in ((self._lines, self._lines.standing), (self._voltages, self._voltages.measured)):
            try:
                with self._device_errors():
                    answers = asked()
            except Exception as error:
                found |= dict.fromkeys(group.outputs, ReadBack(why=str(error)))
            else:
                found |= {n: CANNOT_BE_ASKED if math.isnan(at) else ReadBack(at) for n, at in answers.items()}
        return found

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
            self._switch(outputs)
            start_s = self._started(writers, reading, outputs, samples)
            for first in range(0, len(waveform), block_samples):
                count = min(block_samples, len(waveform) - first)
                yield self._block(reading, outputs, first, count, start_s, waveform.rate_hz)
            if samples > len(waveform):
                self._read(reading, samples - len(waveform), waveform.rate_hz)
        self._outputs_stand(self._voltages.standing)

    def _continuous(self, waveforms: Iterator[Waveform]) -> Iterator[Block]:
        from nidaqmx.constants import AcquisitionType, RegenerationMode

        playing, failure = next_or_failure(waveforms)
        if playing is None:
            if failure is not None:
                raise failure
            return
        rate_hz, first = playing.rate_hz, 0
        with self._task(rate_hz, AcquisitionType.CONTINUOUS, max(_LEAST, 8 * len(playing))) as (writers, reading):
            for writer in writers:
                writer.task.out_stream.regen_mode = RegenerationMode.DONT_ALLOW_REGENERATION
            outputs = self._whole(playing)
            following, failure = next_or_failure(waveforms)
            ahead = self._after(outputs, following, rate_hz)
            both = {name: np.concatenate((values, ahead[name])) for name, values in outputs.items()}
            self._switch(outputs)
            start_s = self._started(writers, reading, both, len(next(iter(both.values()), np.empty(0))))
            while True:
                yield self._block(reading, outputs, 0, len(playing), start_s + first / rate_hz, rate_hz)
                first += len(playing)
                if following is None:
                    break
                playing, outputs = following, ahead
                self._switch(outputs)
                following, failure = next_or_failure(waveforms)
                ahead = self._after(outputs, following, rate_hz)
                self._write(writers, ahead, start=False)
        self._outputs_stand(self._voltages.standing)
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
        for name in self.outputs.keys() - waveform.outputs.keys():
            if math.isnan(standing[name]):
                raise LinkError(
                    f"{self._settings.device} does not tell where '{name}' stands; drive it, or make it safe"
                )
        return {name: np.asarray(waveform.outputs.get(name, np.full(len(waveform), standing[name])), dtype=np.float64)
                for name in self.outputs}  # fmt: skip

    @contextmanager
    def _task(self, rate_hz: float, mode: Any, samples: int) -> Iterator[tuple[list[_Writer], Any]]:
        """The tasks of outputs and of inputs, on one clock, not started; afterwards counters keep up their level."""
        import nidaqmx

        self._end_tasks()
        try:
            with self._device_errors():
                reading = nidaqmx.Task()
                self._tasks.append(reading)
                self._add_inputs(reading)
                reading.timing.cfg_samp_clk_timing(rate_hz, sample_mode=mode, samps_per_chan=samples)
                if self.promises.skew_s:
                    reading.timing.ai_conv_rate = 1.0 / self._settings.skew_s
                self._check_rate(reading, rate_hz)
                writers = [*self._analogue_writers(rate_hz, mode, samples), *self._pwm_writers(rate_hz, mode, samples)]
            yield writers, reading
        finally:
            self._end_tasks()
            held = self.levels
            self.levels = {**held, **dict.fromkeys(self._counters.channels, 0.0)}
        with self._device_errors():
            for task in self._counters.held(held):
                self._tasks.append(task)
        self.levels = held

    def _analogue_writers(self, rate_hz: float, mode: Any, samples: int) -> Iterator[_Writer]:
        import nidaqmx

        if not self._voltages.outputs:
            return
        writing = nidaqmx.Task()
        self._tasks.append(writing)
        self._voltages.add_to(writing)
        writing.timing.cfg_samp_clk_timing(rate_hz, sample_mode=mode, samps_per_chan=samples)
        writing.triggers.start_trigger.cfg_dig_edge_start_trig(f"/{self._settings.device}/ai/StartTrigger")
        self._check_rate(writing, rate_hz)
        yield _Writer(writing, tuple(self._voltages.outputs), _packed)

    def _pwm_writers(self, rate_hz: float, mode: Any, samples: int) -> Iterator[_Writer]:
        for name, task in self._counters.clocked(self.levels, rate_hz, mode, samples):
            self._tasks.append(task)
            yield _Writer(task, (name,), lambda rows: self._counters.samples(rows[0]))

    def _add_inputs(self, task: Any) -> None:
        for channel in self._sampled.values():
            task.ai_channels.add_ai_voltage_chan(
                f"{self._settings.device}/{channel.terminal}", terminal_config=configuration(self._settings.wiring),
                min_val=channel.low, max_val=channel.high,
            )  # fmt: skip
        if not self._sampled:
            task.ai_channels.add_ai_voltage_chan(f"{self._settings.device}/{_GROUND}", min_val=-10.0, max_val=10.0)

    def _made_of(self, rate_hz: float) -> float:
        import nidaqmx
        from nidaqmx.constants import AcquisitionType

        with self._device_errors(), nidaqmx.Task() as task:
            self._add_inputs(task)
            task.timing.cfg_samp_clk_timing(rate_hz, sample_mode=AcquisitionType.CONTINUOUS, samps_per_chan=_LEAST)
            return float(task.timing.samp_clk_rate)

    def _check_rate(self, task: Any, rate_hz: float) -> None:
        real_hz = float(task.timing.samp_clk_rate)
        if abs(real_hz - rate_hz) > 1e-6 * rate_hz:
            raise LinkError(
                f"{self._settings.device} makes {real_hz:.9g} Hz of {rate_hz:.9g} Hz: its rates are divisions of its "
                f"own clocks, and those of inputs and outputs differ; ask for a rate that both make"
            )

    def _started(self, writers: list[_Writer], reading: Any, outputs: Mapping[str, Array], samples: int) -> float:
        """Fill the buffers and start; the time of the first sample on the device's clock."""
        padded = {name: np.append(v, np.full(samples - len(v), v[-1])) for name, v in outputs.items()}
        self._write(writers, padded, start=True)
        with self._device_errors():
            reading.start()
        self._after_s = max(self._after_s, system.now_s() - self._zero_s)
        return self._after_s

    def _write(self, writers: list[_Writer], outputs: Mapping[str, Array], start: bool) -> None:
        with self._device_errors():
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
        with self._device_errors():  # before lines are looked at: a heartbeat that failed left its own on or off
            self._lines.check()
        self._outputs_stand(self._lines.standing)
        self._after_s = float(time_s[-1]) + 1.0 / rate_hz
        clipped = {
            n: np.clip(row, c.low, c.high)
            for (n, c), row in zip(self._sampled.items(), rows, strict=len(self._sampled) > 0)
        }
        return Block(time_s, {**clipped, **self._lines_over(count)}, driven)

    def _outputs_stand(self, standing: Callable[[], Mapping[str, float]]) -> None:
        """Raise `LinkError` where outputs stand elsewhere: lines after each block, voltages when a task has ended.

        While they are played, the inputs that measure voltages within the board are not free.
        """
        with self._device_errors():
            found = {name: at for name, at in standing().items() if not math.isnan(at)}
        for name, at in found.items():
            if not stands_as_driven(at, (self.levels[name],), _CLOSE):
                raise LinkError(
                    f"{self._settings.device}: '{name}' stands at {at:.4g}, not at {self.levels[name]:.4g} as it was "
                    f"driven: it does not obey, or another program drives it"
                )

    def _lines_over(self, count: int) -> dict[str, Array]:
        """Digital inputs over a block that was just read: as known before, and from its last sample on as they are."""
        with self._device_errors():
            known, self._known = self._known, self._lines.read()
        return {name: np.append(np.full(count - 1, known[name]), now) for name, now in self._known.items()}

    def _read(self, reading: Any, count: int, rate_hz: float) -> Array:
        with self._device_errors():
            read = reading.read(number_of_samples_per_channel=count, timeout=count / rate_hz + _WAIT_S)
        return np.asarray(read, dtype=np.float64).reshape(max(1, len(self._sampled)), count)

    def _switch(self, outputs: Mapping[str, Array]) -> None:
        """Digital outputs as a waveform that begins now wants them."""
        wanted = {name: float(outputs[name][0]) for name in self._lines.outputs}
        changed = {name: value for name, value in wanted.items() if value != self.levels[name]}
        if changed:
            with self._device_errors():
                self._lines.drive(changed)
            self.levels = {**self.levels, **changed}

    def _device_errors(self) -> AbstractContextManager[None]:
        return device_errors(self._settings.device)

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


def _packed(rows: list[Array]) -> Array:
    return np.array(rows) if len(rows) > 1 else rows[0]


def _of_kind(channels: Mapping[str, _Channel], prefix: str) -> dict[str, _Channel]:
    """The channels on terminals of one kind: `ao`, `ctr`, `do`, `hb`, `ai`, `di`."""
    return {name: channel for name, channel in channels.items() if channel.terminal.rstrip("0123456789") == prefix}


def _lines_of(settings: Settings, wiring: Wiring) -> Lines:
    steady, beating = _of_kind(wiring.outputs, "do"), _of_kind(wiring.outputs, "hb")
    for name, channel in beating.items():
        for other, one in steady.items():
            if one.terminal[2:] == channel.terminal[2:]:
                raise SettingError(f"'{name}': {channel.terminal} is the line of {one.terminal}, which '{other}' has")
    line = f"{settings.device}/port{settings.output_port}/line"
    every_s = settings.heartbeat_s or 0.0
    beats = {name: Heartbeat(f"{line}{channel.terminal[2:]}", every_s) for name, channel in beating.items()}
    inputs = _of_kind(wiring.inputs, "di")
    return Lines(settings.device, settings.output_port, settings.input_port, {**steady, **beating}, inputs, beats)


def _check_counters(outputs: Mapping[str, OutputChannel]) -> None:
    for name, channel in _of_kind(outputs, "ctr").items():
        if channel.safe != 0.0:
            raise SettingError(
                f"'{name}': safe = {channel.safe:g} %; {channel.terminal} stands still once the program lets go of it, "
                f"so only 0 % can be its safe value"
            )
