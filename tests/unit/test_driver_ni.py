"""The NI driver on an imitation of NI-DAQmx: what it asks for, in which order, and what it makes of error codes."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from nidaqmx.constants import AcquisitionType, RegenerationMode

from drivers import ni
from hil.clock import VirtualClock
from hil.daq.channel import Wiring
from hil.daq.contract import Waveform, joined
from hil.errors import (
    DeviceLostError,
    HardwareError,
    LinkError,
    OutputUnderflowError,
    OverrunError,
    RangeError,
    SettingError,
)
from hil.safety.guard import Guard
from hil.safety.outputs import Outputs
from hil.safety.protection import Protection
from tests.channels import inputs, outputs
from tests.driven import played
from tests.ni_board import Board, Task, plugged_in

RATE_HZ = 1000.0
PWM = outputs({"duty": "ctr0"}, "%", 0.0, 100.0)
WIRING = Wiring(
    outputs({"a": "ao0"}, safe=1.0) | outputs({"b": "ao1"}, low=0.0, safe=0.5),
    inputs({"read 0": "ai0", "read 1": "ai1"}),
)


@pytest.fixture
def board(monkeypatch):
    return plugged_in(monkeypatch)


@pytest.fixture
def daq(board):
    return ni.open_daq(ni.Settings(), WIRING)


def ramp(samples: int = 30) -> Waveform:
    return Waveform(RATE_HZ, {"a": np.linspace(0.0, 2.0, samples)})


def test_outputs_are_found_where_they_stand(daq):
    assert daq.levels == {"a": 3.0, "b": 4.0}


def test_outputs_wait_for_the_trigger_of_the_inputs_and_start_first(daq, board):
    block = played(daq, ramp(), 10)
    assert board.calls[:2] == ["start outputs", "start inputs"]
    assert np.array_equal(block.outputs["a"], ramp().outputs["a"]) and (block.outputs["b"] == 4.0).all()
    assert np.array_equal(block.inputs["read 0"][1:], block.outputs["a"][:-1])  # read before it is driven
    assert np.diff(block.time_s) == pytest.approx(1.0 / RATE_HZ)
    assert daq.levels["a"] == 2.0 and board.open == 0


def test_ranges_and_wiring_are_said_as_the_default_is_five_volts(daq, monkeypatch):
    seen = []
    monkeypatch.setattr(Task, "close", lambda self: seen.extend(self.kwargs))
    played(daq, ramp(4))
    assert {(k["min_val"], k["max_val"]) for k in seen} == {(-10.0, 10.0), (0.0, 10.0)}
    assert [k["terminal_config"].name for k in seen if "terminal_config" in k] == ["DIFF", "DIFF"]


def test_one_sample_is_played_though_a_buffer_needs_two(daq):
    (block,) = daq.play(Waveform(RATE_HZ, {"a": np.array([1.5])}))
    assert len(block) == 1 and daq.levels["a"] == 1.5


def test_finite_and_continuous_acquisition_say_the_same(board):
    blocks = []
    for finite in (True, False):
        board.levels |= {"ao0": 0.0, "ao1": 0.0}
        daq = ni.open_daq(ni.Settings(), WIRING)
        blocks.append(joined(list(daq.play(ramp()) if finite else daq.stream(ramp().slices(7)))))
    assert np.array_equal(blocks[0].inputs["read 0"], blocks[1].inputs["read 0"])
    assert np.array_equal(blocks[0].outputs["a"], blocks[1].outputs["a"])


def test_stream_never_regenerates(daq, monkeypatch):
    modes = []
    monkeypatch.setattr(
        Task, "start", lambda self, start=Task.start: (modes.append((self.mode, self.regen_mode)), start(self))
    )
    list(daq.stream(ramp().slices(10)))
    assert modes[0] == (AcquisitionType.CONTINUOUS, RegenerationMode.DONT_ALLOW_REGENERATION)


def test_safe_values_are_written_at_once(daq, board):
    blocks = daq.play(ramp(), 5)
    next(blocks)
    daq.make_safe()
    assert (board.levels["ao0"], board.levels["ao1"]) == (1.0, 0.5) and daq.levels == {"a": 1.0, "b": 0.5}
    daq.close()
    daq.close()
    assert board.open == 0


@pytest.mark.parametrize(
    ("code", "kind"),
    [
        (-200284, LinkError), (-200279, OverrunError), (-200361, OverrunError), (-200621, OutputUnderflowError),
        (-200045, DeviceLostError), (-999999, LinkError),
    ],
)  # fmt: skip
def test_codes_become_errors_of_one_line_with_the_whole_cause(daq, board, code, kind):
    board.codes["read"] = code
    with pytest.raises(kind) as raised:
        played(daq, ramp())
    assert str(raised.value) == f"Dev1: the reason. Device: Dev1 ({code})" and board.open == 0


def test_lines_that_another_task_holds_are_told_with_what_may_hold_them(daq, board):
    board.codes["read"] = -50103
    with pytest.raises(LinkError, match=r"\(-50103\): another task or program holds it, such as"):
        played(daq, ramp())


@pytest.mark.parametrize("code", [-200324, -200045, -50808, -201003, -88705, -50405, -88302, -200284, -999999])
def test_outputs_that_cannot_be_made_safe_are_told_with_the_remedy(daq, board, code):
    board.gone = code
    with pytest.raises(DeviceLostError) as raised:
        daq.make_safe()
    assert str(raised.value) == f"Dev1: the reason. Device: Dev1 ({code})"
    known = Outputs()
    known.opened(daq.outputs)
    known.make_safe(daq, clock=VirtualClock())
    remedy = f"(Dev1: the reason. Device: Dev1 ({code})): use the emergency stop"
    assert known.text.count(remedy) == 2 and known.status(None, 0) == 3


def test_lost_board_ends_a_run_with_the_emergency_stop(daq, board):
    guard = Guard(daq, Protection(RATE_HZ))
    blocks = guard.play(ramp(), 5)
    next(blocks)
    board.gone = -88705
    with pytest.raises(HardwareError, match=r"\(-88705\)"):
        next(blocks)
    assert (
        "nobody knows where 'a' stands" in guard.output_states.text
        and "use the emergency stop" in guard.output_states.text
    )
    guard.close()
    assert guard.output_states.status(None, 0) == 3


def test_late_program_meets_an_underflow(daq, board):
    blocks = daq.stream(ramp(40).slices(10))
    next(blocks)
    board.playing.done = 999  # the hardware went on while the program slept
    with pytest.raises(OutputUnderflowError, match="-200290"):
        list(blocks)


def test_rate_is_what_the_board_makes_of_it(board):
    board.rates_of = 51200.0
    daq = ni.open_daq(ni.Settings(), WIRING)
    assert daq.actual_rate_hz(1000.0) == pytest.approx(51200.0 / 51) and daq.actual_rate_hz(2048.0) == 2048.0
    made_hz = daq.actual_rate_hz(1000.0)
    assert daq.actual_rate_hz(made_hz) == made_hz
    (block,) = daq.play(Waveform(made_hz, {"a": np.linspace(0.0, 1.0, 20)}))
    assert np.diff(block.time_s) == pytest.approx(51 / 51200.0)


def test_rates_of_inputs_and_outputs_that_differ_are_told(daq, board):
    board.output_hz = 999.0
    with pytest.raises(LinkError, match="Dev1 makes 999 Hz of 1000 Hz: its rates are divisions of its own clocks"):
        played(daq, ramp())


def test_rates_and_ranges_that_it_does_not_have_are_refused(daq):
    with pytest.raises(RangeError, match="Hz"):
        daq.actual_rate_hz(1e6)
    with pytest.raises(RangeError, match="'b', sample 1"):
        played(daq, Waveform(RATE_HZ, {"b": np.array([1.0, -0.5])}))
    assert daq.actual_rate_hz(daq.actual_rate_hz(333.3)) == daq.actual_rate_hz(333.3)


def test_outputs_alone_are_timed_by_the_clock_of_an_input_within_the_board(board):
    daq = ni.open_daq(ni.Settings(), Wiring(WIRING.outputs, {}))
    block = played(daq, ramp(), 7)
    assert np.array_equal(block.outputs["a"], ramp().outputs["a"]) and block.inputs == {}
    assert board.levels["ao0"] == 2.0
    daq.close()
    assert (board.levels["ao0"], board.levels["ao1"]) == (1.0, 0.5) and board.open == 0


def test_where_the_board_does_not_tell_its_outputs_it_drives_nothing_beside_them(board):
    board.internal = False
    daq = ni.open_daq(ni.Settings(), WIRING)
    assert all(np.isnan(level) for level in daq.levels.values())
    with pytest.raises(LinkError, match="Dev1 does not tell where 'b' stands; drive it, or make it safe"):
        played(daq, ramp())
    daq.make_safe()
    assert daq.levels == {"a": 1.0, "b": 0.5} and len(played(daq, ramp())) == 30


RELAY = outputs({"enable": "do1"}, "1", 0.0, 1.0)
STOP = inputs({"stop": "di2"}, "1", 0.0, 1.0)


@pytest.fixture
def lines(board):
    board.levels["port0/line2"] = 1.0
    return ni.open_daq(ni.Settings(), Wiring({**WIRING.outputs, **RELAY}, {**STOP, **WIRING.inputs}))


@pytest.mark.parametrize("finite", [True, False])
def test_relay_is_switched_before_the_waveform_that_wants_it(lines, board, finite):
    closed = [Waveform(RATE_HZ, {"enable": np.full(10, value)}) for value in (1.0, 1.0, 0.0)]
    seen = []
    for block in (b for w in closed for b in lines.play(w)) if finite else lines.stream(closed):
        seen.append((block.outputs["enable"][0], board.levels["port1/line1"]))
    assert seen == [(1.0, 1.0), (1.0, 1.0), (0.0, 0.0)]
    assert lines.levels == {"a": 3.0, "b": 4.0, "enable": 0.0}


def test_relay_opens_first_and_alone_if_need_be(lines, board):
    played(lines, Waveform(RATE_HZ, {"enable": np.ones(5)}))
    board.calls.clear()
    lines.make_safe()
    assert board.calls == ["write port1/line1 [0.0]", "write  [1.0, 0.5]"]
    board.codes["write"] = -200324
    with pytest.raises(DeviceLostError, match=r"the reason.*\(-200324\)"):
        lines.make_safe()
    assert board.calls[-1] == "write  [1.0, 0.5]"


BEAT = outputs({"relay": "hb3"}, "1", 0.0, 1.0)


def edges(board: Board, for_s: float) -> int:
    """How often the line changes."""
    until_s, count, last = time.monotonic() + for_s, 0, board.levels["port1/line3"]
    while time.monotonic() < until_s:
        level = board.levels["port1/line3"]
        count, last = count + (level != last), level
        time.sleep(0.001)
    return count


def edges_come(board: Board) -> bool:
    """It changes six times more, however long that takes."""
    seen = 0
    while seen < 6:
        seen += edges(board, 0.05)
    return True


def test_heartbeat_changes_while_it_is_on_and_stands_still_when_safe(board):
    daq = ni.open_daq(ni.Settings(heartbeat_s=0.005), Wiring({**WIRING.outputs, **BEAT}, WIRING.inputs))
    assert daq.levels["relay"] == 0.0 and edges(board, 0.05) == 0
    played(daq, Waveform(RATE_HZ, {"relay": np.ones(5)}))
    assert daq.levels["relay"] == 1.0 and edges_come(board)
    list(daq.play(ramp()))  # it goes on
    assert edges_come(board) and daq.read_back()["relay"].at == 1.0
    daq.make_safe()
    assert board.levels["port1/line3"] == 0.0 and edges(board, 0.05) == 0 and board.open == 0
    daq.close()


@pytest.mark.parametrize("stands_at", [0.0, 1.0])
def test_heartbeat_that_fails_ends_the_task(board, stands_at):
    """Wherever the line stood when it failed: the board's reason is told, not what the line looks like."""
    daq = ni.open_daq(ni.Settings(heartbeat_s=0.005), Wiring({**WIRING.outputs, **BEAT}, WIRING.inputs))
    played(daq, Waveform(RATE_HZ, {"relay": np.ones(5)}))
    board.codes["write"] = -200324
    while any(thread.name == "hil-heartbeat" for thread in threading.enumerate()):
        time.sleep(0.001)
    board.levels["port1/line3"] = stands_at
    with pytest.raises(DeviceLostError, match="-200324"):
        played(daq, Waveform(RATE_HZ, {"relay": np.ones(5)}))
    daq.close()
    assert board.open == 0


def test_line_is_a_heartbeat_or_not(board):
    assert "hb0" not in ni.terminals(ni.Settings()) and "hb3" in ni.terminals(ni.Settings(heartbeat_s=0.1))
    with pytest.raises(SettingError, match="'relay': hb3 is the line of do3, which 'enable' has"):
        ni.open_daq(ni.Settings(heartbeat_s=0.1), Wiring(outputs({"enable": "do3"}, "1", 0.0, 1.0) | BEAT, {}))


def test_found_relay_and_input_are_as_they_stand(board):
    board.levels |= {"port1/line1": 1.0, "port0/line2": 1.0}
    daq = ni.open_daq(ni.Settings(), Wiring(RELAY, STOP))
    (block,) = daq.play(Waveform(RATE_HZ, {"enable": np.ones(4)}))
    assert daq.levels == {"enable": 1.0} and block.inputs["stop"].tolist() == [1.0, 1.0, 1.0, 1.0]


def test_line_that_another_program_switches_ends_the_task(lines, board):
    blocks = lines.stream([Waveform(RATE_HZ, {"enable": np.ones(5)})] * 3)
    next(blocks)
    board.levels["port1/line1"] = 0.0
    with pytest.raises(LinkError, match="Dev1: 'enable' stands at 0, not at 1 as it was driven"):
        list(blocks)


def test_voltage_that_does_not_stand_where_it_was_driven_is_told_when_the_task_ends(daq, board):
    blocks = daq.play(ramp(), 15)
    assert [len(next(blocks)) for _ in range(2)] == [15, 15]
    board.levels["ao0"] = 2.3
    with pytest.raises(LinkError, match=r"'a' stands at 2\.3, not at 2 as it was driven"):
        list(blocks)


def test_line_that_falls_is_seen_at_the_end_of_its_block(lines, board):
    blocks = lines.play(ramp(), 5)
    assert next(blocks).inputs["stop"].tolist() == [1.0] * 5
    board.levels["port0/line2"] = 0.0
    assert [next(blocks).inputs["stop"].tolist() for _ in range(2)] == [[1.0] * 4 + [0.0], [0.0] * 5]
    board.calls.clear()


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ([0.0, 1.0], "switched by software, so that it changes only between two waveforms"),
        ([0.5, 0.5], "nothing between"),
    ],
)
def test_line_is_no_waveform(lines, values, says):
    waveform = Waveform(RATE_HZ, {"enable": np.array(values)})
    with pytest.raises(RangeError, match=says):
        lines.play(waveform)
    with pytest.raises(RangeError, match=says):
        list(lines.stream([waveform]))


def test_pairs_are_those_of_the_board(board):
    def opened(terminal):
        wiring = Wiring({}, inputs({"p": terminal}))
        return ni.open_daq(ni.Settings(inputs=32), wiring)

    board.inputs, board.pairs = list(range(32)), [*range(8), *range(16, 24)]
    assert "ai16" in ni.terminals(ni.Settings(inputs=32)) and "ai8" not in ni.terminals(ni.Settings(inputs=32))
    opened("ai16").close()
    with pytest.raises(SettingError, match=r'no ai8 with wiring = "diff"; it has: ai0 … ai7, ai16 … ai23'):
        opened("ai8")


def test_board_that_samples_all_at_once_has_no_convert_clock(board, monkeypatch):
    rates = []
    monkeypatch.setattr(Task, "close", lambda self, close=Task.close: (rates.append(self.ai_conv_rate), close(self)))
    daq = ni.open_daq(ni.Settings(skew_s=0.0), WIRING)
    played(daq, ramp(4))
    assert daq.promises.simultaneous and set(rates) == {0.0}
    assert [text for _, text in ni.faults(ni.Settings(skew_s=1e-9))]


def test_without_the_driver_of_ni_it_says_so():
    with pytest.raises(DeviceLostError, match="NI-DAQmx is not installed"):
        ni.open_daq(ni.Settings(), WIRING)


def test_odd_inputs_are_no_pairs_and_lines_of_both_directions_need_two_ports():
    for told, places in ({"inputs": 15}, ["inputs"]), ({"input_port": 1}, ["input_port"]), (
        {"input_port": 1, "digital_inputs": 0}, []):  # fmt: skip
        assert [place for (place,), _ in ni.faults(ni.Settings(**told))] == places
    assert len(ni.terminals(ni.Settings())) == 2 + 8 + 4 + 4


@pytest.fixture
def pwm(board):
    return ni.open_daq(ni.Settings(counters=1), Wiring({**WIRING.outputs, **PWM}, WIRING.inputs))


def seen_while_reading(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Duty cycle of the counter after each edge of the sample clock."""
    seen: list[float] = []
    count = Task.count
    monkeypatch.setattr(Task, "count", lambda self: (count(self), seen.append(self.board.levels["ctr0"])))
    return seen


@pytest.mark.parametrize("finite", [True, False])
def test_duty_cycle_follows_the_samples_on_the_clock_of_the_inputs(pwm, board, monkeypatch, finite):
    seen = seen_while_reading(monkeypatch)
    duty = Waveform(RATE_HZ, {"duty": np.linspace(10.0, 90.0, 30)})
    block = joined(list(pwm.play(duty, 7) if finite else pwm.stream(duty.slices(7))))
    assert seen[:30] == pytest.approx(np.linspace(0.1, 0.9, 30))
    assert np.array_equal(block.outputs["duty"], duty.outputs["duty"]) and (block.outputs["a"] == 3.0).all()
    assert board.calls[:3] == ["start outputs", "start counter", "start inputs"]
    assert board.pulses_hz == {1000.0}


def test_duty_cycle_is_kept_up_between_tasks_and_until_the_next_one(pwm, board):
    played(pwm, Waveform(RATE_HZ, {"duty": np.full(5, 40.0)}))
    assert board.levels["ctr0"] == pytest.approx(0.4) and pwm.levels["duty"] == 40.0
    block = played(pwm, ramp(5))
    assert (block.outputs["duty"] == 40.0).all() and board.levels["ctr0"] == pytest.approx(0.4)
    pwm.make_safe()
    assert board.levels["ctr0"] == 0.0 and pwm.levels == {"a": 1.0, "b": 0.5, "duty": 0.0}
    pwm.close()
    assert board.open == 0


def test_counter_stands_still_when_a_task_is_left_early(pwm, board):
    blocks = pwm.play(Waveform(RATE_HZ, {"duty": np.full(20, 40.0)}), 5)
    next(blocks)
    assert board.levels["ctr0"] == pytest.approx(0.4)
    blocks.close()  # type: ignore[attr-defined]
    assert board.levels["ctr0"] == 0.0 and pwm.levels["duty"] == 0.0 and board.open == 0


def test_ends_of_the_range_are_pulses_and_pauses_of_100_ns(pwm, monkeypatch):
    seen = seen_while_reading(monkeypatch)
    played(pwm, Waveform(RATE_HZ, {"duty": np.array([0.0, 100.0, 50.0])}))
    assert seen[:3] == pytest.approx([1e-4, 1.0 - 1e-4, 0.5])


def test_counter_alone_needs_no_voltage_output(board):
    daq = ni.open_daq(ni.Settings(counters=1, pwm_hz=200.0), Wiring(PWM, WIRING.inputs))
    block = played(daq, Waveform(RATE_HZ, {"duty": np.array([25.0])}))
    assert len(block) == 1 and daq.levels == {"duty": 25.0} and board.pulses_hz == {200.0}
    assert board.levels["ao0"] == 3.0
    daq.close()
    assert board.levels["ctr0"] == 0.0 and board.open == 0


def test_counter_that_cannot_be_started_is_let_go_of(pwm, board):
    board.codes["start"] = -200022
    with pytest.raises(LinkError, match="-200022"):
        played(pwm, Waveform(RATE_HZ, {"duty": np.full(5, 40.0)}))
    assert board.open == 0


def test_only_standing_still_can_be_safe_for_a_counter(board):
    unsafe = outputs({"duty": "ctr0"}, "%", 0.0, 100.0, 10.0)
    with pytest.raises(SettingError, match=r"'duty': safe = 10 %; ctr0 stands still .* only 0 % can be its safe value"):
        ni.open_daq(ni.Settings(counters=1), Wiring(unsafe, WIRING.inputs))


def test_counters_are_terminals_where_the_device_is_said_to_have_them():
    assert "ctr0" not in ni.terminals(ni.Settings())
    assert [name for name in ni.terminals(ni.Settings(counters=2)) if name.startswith("ctr")] == ["ctr0", "ctr1"]
