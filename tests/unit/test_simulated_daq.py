"""The simulated DAQ: converters, multiplexer, noise, clock and faults."""

from __future__ import annotations

import time

import numpy as np
import pytest
from simulated import FLOW, READ_BACK, SPOOL, efc, hpv41

from hil.clock import VirtualClock
from hil.daq.channel import Pwm
from hil.daq.contract import Waveform, joined
from hil.errors import DeviceLostError, OutputUnderflowError, OverrunError, RangeError
from hil.physics.compose import plant
from hil.physics.simulate import Drive, simulate
from tests.driven import played

LSB_V = 20.0 / 2**16


def steps(*volts: float, samples: int = 200) -> Waveform:
    return Waveform(1000.0, {"command": np.repeat(volts, samples)})


def test_first_input_is_read_on_the_edge_that_updates_the_output():
    daq = hpv41({"now": READ_BACK, "later": READ_BACK}, skew_s=14e-6)
    block = played(daq, Waveform(1000.0, {"command": np.array([1.0, 2.0, 3.0])}))
    assert block.inputs["now"] == pytest.approx([0.0, 1.0, 2.0], abs=LSB_V)
    assert block.inputs["later"] == pytest.approx([1.0, 2.0, 3.0], abs=LSB_V)


def test_skew_reads_the_plant_later_within_the_sample():
    inputs = {"first": SPOOL, **{f"unused {i}": {"value": 0.0} for i in range(4)}, "late": SPOOL}
    daq = hpv41(inputs, skew_s=100e-6, bits=24)
    block = played(daq, steps(2.0, 8.0))
    first, late = 12.5 * block.inputs["first"], 12.5 * block.inputs["late"]
    assert late[:-1] == pytest.approx(first[:-1] + 0.5 * np.diff(first), abs=1e-4)
    assert np.max(np.abs(late - first)) > 0.05


def test_plant_is_the_one_of_the_physics():
    daq = hpv41({"flow": {**FLOW, "slope": 10.0}}, bits=24)
    block = played(daq, steps(6.0, 3.0, -5.0))
    hpv = plant("brevini-hpv41")
    drive = Drive(10.0 * np.concatenate(([0.0], block.outputs["command"]))[None], np.nan, 1e-3)
    expected = simulate(hpv, hpv.typical, drive)[0][1:]
    assert 10.0 * block.inputs["flow"] == pytest.approx(expected, abs=1e-4)


def test_readings_are_whole_codes_and_clip_at_the_last_one():
    daq = hpv41({"flow": {**FLOW, "noise": 0.5}, "beyond": {**READ_BACK, "slope": 2.0}})
    block = played(daq, steps(5.0))
    codes = block.inputs["flow"] / LSB_V
    assert codes == pytest.approx(np.rint(codes), abs=1e-9)
    assert block.inputs["beyond"][1:] == pytest.approx(10.0 - LSB_V)


def test_noise_is_as_large_as_said_and_different_on_each_channel():
    daq = hpv41({"flow": {**FLOW, "noise": 0.3}, "again": {**FLOW, "noise": 0.3}}, noise_v=0.04)
    block = played(daq, steps(0.0, samples=20_000))
    expected = np.hypot(0.03, 0.04)
    assert block.inputs["flow"].std() == pytest.approx(expected, rel=0.03)
    assert abs(np.corrcoef(block.inputs["flow"], block.inputs["again"])[0, 1]) < 0.03


def test_output_is_held_between_tasks_and_time_goes_on():
    daq = hpv41({"read back": READ_BACK})
    first, second = (played(daq, steps(volts, samples=5)) for volts in (4.0, 2.0))
    assert np.concatenate((first.time_s, second.time_s)) == pytest.approx(np.arange(10) / 1000.0)
    assert second.inputs["read back"][0] == pytest.approx(4.0, abs=LSB_V)
    assert daq.levels == {"command": 2.0}


def test_plant_goes_on_while_nothing_plays():
    clock = VirtualClock(50.0)
    daq = hpv41({"flow": FLOW}, clock=clock, time="real")
    rising = played(daq, steps(6.0, samples=20))
    clock.sleep_until(clock.now_s + 5.0)
    later = played(daq, steps(6.0, samples=20))
    assert rising.inputs["flow"][-1] < 0.5
    assert 10.0 * later.inputs["flow"] == pytest.approx(70.0 * 0.5**1.2, abs=0.01)
    assert later.time_s[0] == pytest.approx(5.02)


def test_lower_rate_holds_each_value_for_whole_clock_periods():
    fast, slow = hpv41(bits=24), hpv41(bits=24)
    values = np.array([1.0, 5.0, 7.0, -3.0])
    every = played(fast, Waveform(1000.0, {"command": np.repeat(values, 50)}))
    coarse = played(slow, Waveform(20.0, {"command": values}))
    assert coarse.inputs["flow"] == pytest.approx(every.inputs["flow"][::50], abs=1e-9)


def test_power_on_value_is_where_the_plant_has_settled():
    block = joined(list(hpv41({"flow": FLOW}, power_on=6.0).play(steps(6.0, samples=10))))
    assert 10.0 * block.inputs["flow"] == pytest.approx(70.0 * 0.5**1.2, abs=0.01)


def test_unit_of_the_instrument_may_differ_from_the_plants():
    in_gpm = {"signal": "flow", "unit": "gpm", "slope": 2.0}
    block = joined(list(hpv41({"flow": in_gpm}, power_on=6.0).play(steps(6.0, samples=3))))
    assert 2.0 * block.inputs["flow"] == pytest.approx(70.0 * 0.5**1.2 / 3.785411784, abs=1e-3)


def test_dither_is_on_the_coil_and_not_on_the_mean():
    daq = efc(Pwm(1000.0, dither_hz=125.0, dither_amplitude=0.05))
    block = played(daq, Waveform(1000.0, {"current": np.full(801, 1.5)}))
    coil = 0.5 * block.inputs["coil current"][1:]
    assert coil.mean() == pytest.approx(1.5, abs=1e-4)
    assert coil.std() == pytest.approx(0.05 / np.sqrt(2.0), rel=0.01)
    assert (block.outputs["current"] == 1.5).all()


def test_current_drive_neither_pulls_nor_exceeds_itself():
    daq = efc(Pwm(1000.0, dither_hz=125.0, dither_amplitude=0.5))
    block = played(daq, Waveform(1000.0, {"current": np.repeat([0.0, 3.0], 400)}))
    coil = 0.5 * block.inputs["coil current"]
    assert coil.min() >= -1e-3 and coil.max() <= 3.0 + 1e-3


def test_rate_leaves_time_for_every_input_of_the_multiplexer():
    daq = hpv41({f"flow {i}": FLOW for i in range(5)}, skew_s=1e-3, clock_hz=1000.0)
    with pytest.raises(RangeError, match="200 Hz"):
        daq.actual_rate_hz(500.0)
    assert daq.actual_rate_hz(200.0) == 200.0


@pytest.mark.parametrize(("kind", "error"), [("overrun", OverrunError), ("underflow", OutputUnderflowError)])
def test_fault_hands_over_what_was_read_before_it(kind, error):
    daq = hpv41(fault={"kind": kind, "after": 130})
    blocks = []
    with pytest.raises(error):
        blocks.extend(daq.play(steps(5.0), 50))
    assert len(joined(blocks)) == 130
    daq.make_safe()
    assert daq.levels == {"command": 0.0}


def test_lost_device_stays_lost_and_says_nothing_of_its_outputs():
    daq = hpv41(fault={"kind": "lost", "after": 10})
    with pytest.raises(DeviceLostError):
        played(daq, steps(5.0))
    for act in (lambda: list(daq.play(steps(0.0))), daq.make_safe):
        with pytest.raises(DeviceLostError, match="gone after 10 samples"):
            act()
    assert (daq.read_back()["command"].at, daq.read_back()["command"].why) == (None, "the simulated device is gone")
    daq.close()


def test_reader_who_falls_behind_loses_samples():
    clock = VirtualClock()
    blocks = hpv41(clock=clock, time="real", buffer_s=0.5).play(steps(1.0, samples=1000), 100)
    next(blocks)
    clock.sleep_until(clock.now_s + 0.4)
    next(blocks)
    clock.sleep_until(clock.now_s + 0.7)
    with pytest.raises(OverrunError, match="behind the sample clock"):
        next(blocks)


def test_writer_who_falls_behind_lets_the_output_run_dry():
    clock = VirtualClock()
    blocks = hpv41(clock=clock, time="real", buffer_s=0.5).stream(steps(1.0) for _ in range(10))
    next(blocks)
    clock.sleep_until(clock.now_s + 1.0)
    with pytest.raises(OutputUnderflowError):
        next(blocks)


def test_real_time_is_paced_by_the_wall_clock():
    daq = hpv41(time="real")
    start = time.monotonic()
    block = played(daq, steps(1.0, samples=150), 50)
    assert time.monotonic() - start >= 0.150
    assert block.time_s == pytest.approx(block.time_s[0] + np.arange(150) / 1000.0)


def test_stream_asks_for_the_next_waveform_while_one_plays():
    events = []

    def waveforms():
        for i in range(3):
            events.append(f"asked {i}")
            yield steps(1.0, samples=5)

    for i, _ in enumerate(hpv41().stream(waveforms())):
        events.append(f"read {i}")
    assert events == ["asked 0", "asked 1", "read 0", "asked 2", "read 1", "read 2"]


def test_error_of_the_writer_comes_after_what_was_read():
    def waveforms():
        yield steps(1.0, samples=5)
        raise RangeError("too much")

    blocks = hpv41().stream(waveforms())
    assert len(next(blocks)) == 5
    with pytest.raises(RangeError, match="too much"):
        next(blocks)
