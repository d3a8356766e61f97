"""The NI driver on an imitation of NI-DAQmx: what it asks for, in which order, and what it makes of error codes.

The imitation follows the documentation (defaults, shapes, codes, triggers, non-regeneration); no device was there.
"""

from __future__ import annotations

from typing import Any

import nidaqmx
import numpy as np
import pytest
from nidaqmx.constants import AcquisitionType, Level, RegenerationMode
from nidaqmx.errors import DaqError

from drivers import ni
from hil.daq.channel import InputChannel, OutputChannel, Wiring
from hil.daq.contract import Waveform, joined
from hil.errors import DeviceLostError, LinkError, OutputUnderflowError, OverrunError, RangeError, SettingError

RATE_HZ = 1000.0
PWM = {"duty": OutputChannel("duty", "ctr0", "value", "%", 0.0, 100.0)}
WIRING = Wiring(
    {
        "a": OutputChannel("a", "ao0", "voltage", "V", -10.0, 10.0, 1.0),
        "b": OutputChannel("b", "ao1", "voltage", "V", 0.0, 10.0, 0.5),
    },
    {f"read {i}": InputChannel(f"read {i}", f"ai{i}", "voltage", "V", -10.0, 10.0) for i in range(2)},
)


class Board:
    """The device: what stands at its outputs, wired back to its inputs, and every call in order."""

    def __init__(self) -> None:
        self.levels = {"ao0": 3.0, "ao1": 4.0, "ctr0": 0.0}
        self.calls: list[str] = []
        self.playing: Task | None = None
        self.counting: Task | None = None
        self.pulses_hz: set[float] = set()
        self.codes: dict[str, int] = {}
        self.rate_hz: float | None = None
        self.open = 0

    def fail(self, call: str) -> None:
        if call in self.codes:
            raise DaqError("the reason.\nmore words", self.codes.pop(call))


class Task:
    """A task as `nidaqmx.Task` documents it."""

    board: Board

    def __init__(self) -> None:
        self.channels: list[str] = []
        self.kwargs: list[dict[str, Any]] = []
        self.ai_channels = self.ao_channels = self.co_channels = self.timing = self.triggers = self.start_trigger = (
            self.out_stream
        ) = self
        self.regen_mode = RegenerationMode.ALLOW_REGENERATION
        self.samp_clk_rate, self.mode, self.size = 0.0, None, 0
        self.buffer, self.done, self.triggered, self.started = np.empty((0, 0)), 0, "", False
        self.created = 0.0
        self.board.open += 1

    def __enter__(self) -> Task:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def add_ai_voltage_chan(self, channel: str, **kwargs: Any) -> None:
        self.channels.append(channel)
        self.kwargs.append(kwargs)

    add_ao_voltage_chan = add_ai_voltage_chan

    def add_co_pulse_chan_freq(self, counter: str, *, idle_state: Level, freq: float, duty_cycle: float) -> None:
        assert idle_state is Level.LOW and 0.0 < duty_cycle < 1.0
        self.channels.append(counter)
        self.created = duty_cycle
        self.board.pulses_hz.add(freq)

    def cfg_implicit_timing(self, *, sample_mode: Any) -> None:
        assert self.channels[0].startswith("Dev1/ctr") and sample_mode is AcquisitionType.CONTINUOUS

    def cfg_samp_clk_timing(self, rate: float, *, source: str = "", sample_mode: Any, samps_per_chan: int) -> None:
        assert samps_per_chan >= 2 and (source == "/Dev1/ai/SampleClock") == self.is_counter
        self.samp_clk_rate, self.mode, self.size = self.board.rate_hz or rate, sample_mode, samps_per_chan

    def cfg_dig_edge_start_trig(self, source: str) -> None:
        self.triggered = source

    @property
    def is_counter(self) -> bool:
        return self.channels[0].startswith("Dev1/ctr")

    def write(self, data: Any, auto_start: bool, timeout: float = 10.0) -> None:
        self.board.fail("write")
        if self.is_counter:
            pulses = data if isinstance(data, list) else [data]
            self.board.pulses_hz.update(pulse.freq for pulse in pulses)
            data = [pulse.duty_cycle for pulse in pulses]
        rows = np.atleast_2d(np.asarray(data, dtype=float))
        if auto_start:
            if rows.shape[0] != len(self.channels):
                rows = rows.T
            self.board.calls.append(f"write {[float(v) for v in rows[:, -1]]}")
            for channel, row in zip(self.channels, rows, strict=True):
                self.board.levels[channel.split("/")[1]] = float(row[-1])
            return
        if self.done > self.buffer.shape[1]:
            raise DaqError("no new samples", -200290)
        self.buffer = np.hstack([self.buffer.reshape(len(self.channels), -1), rows])

    def start(self) -> None:
        self.board.fail("start")
        self.started = True
        if self.is_counter:
            self.board.calls.append("start counter")
            self.board.counting = self
            self.board.levels["ctr0"] = self.created
        elif self.triggered:
            self.board.calls.append("start outputs")
            self.board.playing = self
        else:
            self.board.calls.append("start inputs")

    def read(self, number_of_samples_per_channel: int | None = None, timeout: float = 10.0) -> Any:
        self.board.fail("read")
        if number_of_samples_per_channel is None:
            return self.board.levels[self.channels[0].split("/_")[1].removesuffix("_vs_aognd")]
        assert self.started
        count, playing = number_of_samples_per_channel, self.board.playing
        read = np.empty((len(self.channels), count))
        for k in range(count):
            for row, channel in zip(read, self.channels, strict=True):
                row[k] = self.board.levels[f"ao{channel[-1]}"]
            if playing is not None and playing.done < playing.buffer.shape[1]:
                for channel, value in zip(playing.channels, playing.buffer[:, playing.done], strict=True):
                    self.board.levels[channel.split("/")[1]] = float(value)
            if playing is not None:
                playing.done += 1
            self.count()
        return read.tolist() if len(read) > 1 else read[0].tolist()

    def count(self) -> None:
        """An edge of the sample clock at the counter."""
        counting = self.board.counting
        if counting is not None and counting.done < counting.buffer.shape[1]:
            self.board.levels["ctr0"] = float(counting.buffer[0, counting.done])
            counting.done += 1

    def stop(self) -> None:
        self.started = False
        if self.board.counting is self:
            self.board.counting, self.board.levels["ctr0"] = None, 0.0
        if self.board.playing is self:
            self.board.playing = None

    def close(self) -> None:
        self.stop()
        self.board.open -= 1


@pytest.fixture
def board(monkeypatch: pytest.MonkeyPatch) -> Board:
    made = Board()
    monkeypatch.setattr(Task, "board", made, raising=False)
    monkeypatch.setattr(nidaqmx, "Task", Task)
    return made


@pytest.fixture
def daq(board: Board) -> ni.NiDaq:
    return ni.open_daq(ni.Settings(), WIRING)


def ramp(samples: int = 30) -> Waveform:
    return Waveform(RATE_HZ, {"a": np.linspace(0.0, 2.0, samples)})


def test_outputs_are_found_where_they_stand(daq: ni.NiDaq) -> None:
    assert daq.levels == {"a": 3.0, "b": 4.0}


def test_outputs_wait_for_the_trigger_of_the_inputs_and_start_first(daq: ni.NiDaq, board: Board) -> None:
    block = joined(list(daq.play(ramp(), 10)))
    assert board.calls[:2] == ["start outputs", "start inputs"]
    assert np.array_equal(block.outputs["a"], ramp().outputs["a"]) and (block.outputs["b"] == 4.0).all()
    assert np.array_equal(block.inputs["read 0"][1:], block.outputs["a"][:-1])  # read before it is driven
    assert np.diff(block.time_s) == pytest.approx(1.0 / RATE_HZ)
    assert daq.levels["a"] == 2.0 and board.open == 0


def test_ranges_and_wiring_are_said_as_the_default_is_five_volts(
    daq: ni.NiDaq, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[dict[str, Any]] = []
    monkeypatch.setattr(Task, "close", lambda self: seen.extend(self.kwargs))
    list(daq.play(ramp(4)))
    assert {(k["min_val"], k["max_val"]) for k in seen} == {(-10.0, 10.0), (0.0, 10.0)}
    assert [k["terminal_config"].name for k in seen if "terminal_config" in k] == ["DIFF", "DIFF"]


def test_one_sample_is_played_though_a_buffer_needs_two(daq: ni.NiDaq) -> None:
    (block,) = daq.play(Waveform(RATE_HZ, {"a": np.array([1.5])}))
    assert len(block) == 1 and daq.levels["a"] == 1.5


def test_finite_and_continuous_acquisition_say_the_same(board: Board) -> None:
    blocks = []
    for finite in (True, False):
        board.levels = {"ao0": 0.0, "ao1": 0.0}
        daq = ni.open_daq(ni.Settings(), WIRING)
        blocks.append(joined(list(daq.play(ramp()) if finite else daq.stream(ramp().slices(7)))))
    assert np.array_equal(blocks[0].inputs["read 0"], blocks[1].inputs["read 0"])
    assert np.array_equal(blocks[0].outputs["a"], blocks[1].outputs["a"])


def test_stream_never_regenerates(daq: ni.NiDaq, monkeypatch: pytest.MonkeyPatch) -> None:
    modes: list[Any] = []
    monkeypatch.setattr(
        Task, "start", lambda self, start=Task.start: (modes.append((self.mode, self.regen_mode)), start(self))
    )
    list(daq.stream(ramp().slices(10)))
    assert modes[0] == (AcquisitionType.CONTINUOUS, RegenerationMode.DONT_ALLOW_REGENERATION)


def test_safe_values_are_written_at_once(daq: ni.NiDaq, board: Board) -> None:
    blocks = daq.play(ramp(), 5)
    next(blocks)
    daq.make_safe()
    assert board.levels == {"ao0": 1.0, "ao1": 0.5, "ctr0": 0.0} and daq.levels == {"a": 1.0, "b": 0.5}
    daq.close()
    daq.close()
    assert board.open == 0


@pytest.mark.parametrize(
    ("code", "kind"),
    [
        (-200284, LinkError), (-200279, OverrunError), (-200361, OverrunError), (-200621, OutputUnderflowError),
        (-200045, DeviceLostError), (-50808, DeviceLostError), (-999999, LinkError),
    ],
)  # fmt: skip
def test_codes_become_errors_of_one_line(daq: ni.NiDaq, board: Board, code: int, kind: type[Exception]) -> None:
    board.codes["read"] = code
    with pytest.raises(kind, match=rf"^Dev1: the reason\. \({code}\)") as raised:
        list(daq.play(ramp()))
    assert ("use the emergency stop" in str(raised.value)) == (kind is DeviceLostError)
    assert board.open == 0


def test_late_program_meets_an_underflow(daq: ni.NiDaq, board: Board) -> None:
    blocks = daq.stream(ramp(40).slices(10))
    next(blocks)
    assert board.playing is not None
    board.playing.done = 999  # the hardware went on while the program slept
    with pytest.raises(OutputUnderflowError, match="-200290"):
        list(blocks)


def test_rate_that_the_device_makes_differently_is_told(daq: ni.NiDaq, board: Board) -> None:
    board.rate_hz = 999.0
    with pytest.raises(LinkError, match="Dev1 uses 999 Hz where 1000 Hz were asked for"):
        list(daq.play(ramp()))


def test_rates_and_ranges_that_it_does_not_have_are_refused(daq: ni.NiDaq) -> None:
    with pytest.raises(RangeError, match="Hz"):
        daq.actual_rate_hz(1e6)
    with pytest.raises(RangeError, match="'b', sample 1"):
        list(daq.play(Waveform(RATE_HZ, {"b": np.array([1.0, -0.5])})))
    assert daq.actual_rate_hz(daq.actual_rate_hz(333.3)) == daq.actual_rate_hz(333.3)


def test_without_an_input_nothing_starts_the_outputs(board: Board) -> None:
    with pytest.raises(LinkError, match="at least one input"):
        ni.open_daq(ni.Settings(), Wiring(WIRING.outputs, {}))


def test_without_the_driver_of_ni_it_says_so() -> None:
    with pytest.raises(DeviceLostError, match="NI-DAQmx is not installed"):
        ni.open_daq(ni.Settings(), WIRING)


def test_odd_inputs_are_no_pairs() -> None:
    assert [place for place, _ in ni.faults(ni.Settings(inputs=15))] == [("inputs",)]
    assert len(ni.terminals(ni.Settings())) == 2 + 8


@pytest.fixture
def pwm(board: Board) -> ni.NiDaq:
    return ni.open_daq(ni.Settings(counters=1), Wiring({**WIRING.outputs, **PWM}, WIRING.inputs))


def seen_while_reading(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Duty cycle of the counter after each edge of the sample clock."""
    seen: list[float] = []
    count = Task.count
    monkeypatch.setattr(Task, "count", lambda self: (count(self), seen.append(self.board.levels["ctr0"])))
    return seen


@pytest.mark.parametrize("finite", [True, False])
def test_duty_cycle_follows_the_samples_on_the_clock_of_the_inputs(
    pwm: ni.NiDaq, board: Board, monkeypatch: pytest.MonkeyPatch, finite: bool
) -> None:
    seen = seen_while_reading(monkeypatch)
    duty = Waveform(RATE_HZ, {"duty": np.linspace(10.0, 90.0, 30)})
    block = joined(list(pwm.play(duty, 7) if finite else pwm.stream(duty.slices(7))))
    assert seen[:30] == pytest.approx(np.linspace(0.1, 0.9, 30))
    assert np.array_equal(block.outputs["duty"], duty.outputs["duty"]) and (block.outputs["a"] == 3.0).all()
    assert board.calls[:3] == ["start outputs", "start counter", "start inputs"]
    assert board.pulses_hz == {1000.0}


def test_duty_cycle_is_kept_up_between_tasks_and_until_the_next_one(pwm: ni.NiDaq, board: Board) -> None:
    list(pwm.play(Waveform(RATE_HZ, {"duty": np.full(5, 40.0)})))
    assert board.levels["ctr0"] == pytest.approx(0.4) and pwm.levels["duty"] == 40.0
    block = joined(list(pwm.play(ramp(5))))
    assert (block.outputs["duty"] == 40.0).all() and board.levels["ctr0"] == pytest.approx(0.4)
    pwm.make_safe()
    assert board.levels["ctr0"] == 0.0 and pwm.levels == {"a": 1.0, "b": 0.5, "duty": 0.0}
    pwm.close()
    assert board.open == 0


def test_counter_stands_still_when_a_task_is_left_early(pwm: ni.NiDaq, board: Board) -> None:
    blocks = pwm.play(Waveform(RATE_HZ, {"duty": np.full(20, 40.0)}), 5)
    next(blocks)
    assert board.levels["ctr0"] == pytest.approx(0.4)
    blocks.close()  # type: ignore[attr-defined]
    assert board.levels["ctr0"] == 0.0 and pwm.levels["duty"] == 0.0 and board.open == 0


def test_ends_of_the_range_are_pulses_and_pauses_of_100_ns(pwm: ni.NiDaq, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = seen_while_reading(monkeypatch)
    list(pwm.play(Waveform(RATE_HZ, {"duty": np.array([0.0, 100.0, 50.0])})))
    assert seen[:3] == pytest.approx([1e-4, 1.0 - 1e-4, 0.5])


def test_counter_alone_needs_no_voltage_output(board: Board) -> None:
    daq = ni.open_daq(ni.Settings(counters=1, pwm_hz=200.0), Wiring(PWM, WIRING.inputs))
    block = joined(list(daq.play(Waveform(RATE_HZ, {"duty": np.array([25.0])}))))
    assert len(block) == 1 and daq.levels == {"duty": 25.0} and board.pulses_hz == {200.0}
    assert board.levels["ao0"] == 3.0
    daq.close()
    assert board.levels["ctr0"] == 0.0 and board.open == 0


def test_counter_that_cannot_be_started_is_let_go_of(pwm: ni.NiDaq, board: Board) -> None:
    board.codes["start"] = -200022
    with pytest.raises(LinkError, match="-200022"):
        list(pwm.play(Waveform(RATE_HZ, {"duty": np.full(5, 40.0)})))
    assert board.open == 0


def test_only_standing_still_can_be_safe_for_a_counter(board: Board) -> None:
    unsafe = {"duty": OutputChannel("duty", "ctr0", "value", "%", 0.0, 100.0, 10.0)}
    with pytest.raises(SettingError, match=r"'duty': safe = 10 %; ctr0 stands still .* only 0 % can be its safe value"):
        ni.open_daq(ni.Settings(counters=1), Wiring(unsafe, WIRING.inputs))


def test_counters_are_terminals_where_the_device_is_said_to_have_them() -> None:
    assert "ctr0" not in ni.terminals(ni.Settings())
    assert [name for name in ni.terminals(ni.Settings(counters=2)) if name.startswith("ctr")] == ["ctr0", "ctr1"]
