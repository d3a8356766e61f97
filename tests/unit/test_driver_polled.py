"""The loop that polls links: stamps, lateness, pauses, failures."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from contextlib import closing

import numpy as np
import pytest

from hil.clock import VirtualClock
from hil.daq.channel import Wiring
from hil.daq.contract import Waveform, joined
from hil.daq.polled import PolledDaq
from hil.errors import DeviceLostError, LinkError, OutputUnderflowError, RangeError, StoppedError
from tests.channels import inputs, outputs
from tests.driven import played
from tests.waits import until

RATE_HZ = 200.0


class Loop:
    """A link whose one input reads its one output; it can be told to be slow, to fail, or to be gone.

    Time passes on the clock, and only while it drives or reads; without a clock it takes none.
    """

    watchdog_s: float | None = None

    def __init__(self, keep_alive_s: float | None = None, clock: VirtualClock | None = None) -> None:
        self.keep_alive_s = keep_alive_s
        self.value, self.takes_s = 1.5, 0.0
        self.failures: list[Exception] = []
        self.stalls: dict[int, float] = {}
        self.slow_readings: dict[int, float] = {}
        self.written: list[float] = []
        self.closed = 0
        self.clock = clock

    def standing(self) -> Mapping[str, float]:
        self._pass(self.takes_s)
        return {"out": self.value}

    def drive(self, values: Mapping[str, float]) -> None:
        self._happen()
        self._pass(self.stalls.pop(len(self.written), 0.0))
        self.value = values["out"]
        self.written.append(self.value)

    def read(self) -> Mapping[str, float]:
        self._happen()
        self._pass(self.slow_readings.pop(len(self.written), 0.0))
        return {"in": self.value}

    def close(self) -> None:
        self.closed += 1

    def _happen(self) -> None:
        self._pass(self.takes_s)
        if self.failures:
            raise self.failures.pop(0)

    def _pass(self, duration_s: float) -> None:
        if self.clock is not None:
            self.clock.sleep_until(self.clock.now_s + duration_s)


def wiring(suffix: str = "") -> Wiring:
    return Wiring(outputs({f"a{suffix}": "out"}, safe=-1.0), inputs({f"b{suffix}": "in"}))


def daq(link: Loop) -> PolledDaq:
    return PolledDaq({"loop": link}, {"loop": wiring()})


def timed(**times: float | dict[int, float]) -> tuple[PolledDaq, Loop]:
    """A device in virtual time whose link takes what it is told to."""
    clock = VirtualClock()
    link = Loop(clock=clock)
    for name, value in times.items():
        setattr(link, name, value)
    return PolledDaq({"loop": link}, {"loop": wiring()}, clock), link


def ramp(samples: int = 20) -> Waveform:
    return Waveform(RATE_HZ, {"a": np.linspace(0.0, 2.0, samples)})


def test_outputs_are_told_where_they_were_found():
    assert daq(Loop()).levels == {"a": 1.5}


def test_each_sample_is_driven_then_read_and_has_the_stamp_it_had():
    device, _ = timed(takes_s=1e-3)
    before_s = 17e-3  # asked where it stands, then eight probes
    block = played(device, ramp(), 7)
    assert np.array_equal(block.inputs["b"], block.outputs["a"])
    assert np.array_equal(block.outputs["a"], ramp().outputs["a"])
    assert block.time_s == pytest.approx(before_s + np.arange(20) / RATE_HZ + 0.5e-3)
    assert block.late == 0


def test_samples_are_taken_as_wall_time_goes_on():
    begun_s = time.monotonic()
    block = joined(list(daq(Loop()).play(ramp(), 7)))
    assert (np.diff(block.time_s) > 0.0).all()
    assert 19 / RATE_HZ < block.time_s[-1] < time.monotonic() - begun_s


def test_each_reading_has_the_delay_that_it_had():
    device, _ = timed(takes_s=1e-3, slow_readings={5: 8e-3, 13: 2e-3})
    block = played(device, ramp(), 7)
    expected_s = np.full(20, 1e-3)
    expected_s[[4, 12]] += [4e-3, 1e-3]  # stamped in the middle of its exchange
    assert block.delays_s["delay of loop"] == pytest.approx(expected_s)
    assert block.columns["delay of loop"] is block.delays_s["delay of loop"]
    promises = device.promises
    assert promises.delay_channels == {"b": "delay of loop"} and promises.delay_names == ("delay of loop",)
    assert promises.delays_s == {"b": pytest.approx(1e-3)}
    assert promises.sampling(device.inputs, RATE_HZ)["read_at"] == 0.0


def test_age_of_what_a_device_tells_unasked_is_part_of_the_delay():
    clock = VirtualClock()
    link = Loop(clock=clock)
    link.reading_age_s = 0.05  # type: ignore[attr-defined]
    device = PolledDaq({"loop": link}, {"loop": wiring()}, clock)
    block = played(device, ramp())
    assert block.delays_s["delay of loop"] == pytest.approx(-0.05)
    assert device.promises.delays_s == {"b": pytest.approx(-0.05)}


def test_delays_are_known_before_the_first_sample():
    clock = VirtualClock()
    first, second = Loop(clock=clock), Loop(clock=clock)
    first.takes_s, second.takes_s = 4e-3, 2e-3
    device = PolledDaq({"x": first, "y": second}, {"x": wiring("1"), "y": wiring("2")}, clock)
    # driving both takes 6 ms and is stamped in the middle; then x is read for 4 ms, y for 2 ms
    assert device.promises.delays_s == {"b1": pytest.approx(5e-3), "b2": pytest.approx(8e-3)}
    block = played(device, Waveform(20.0, {"a1": np.zeros(4)}))
    assert block.delays_s == {
        "delay of x": pytest.approx(np.full(4, 5e-3)),
        "delay of y": pytest.approx(np.full(4, 8e-3)),
    }


def test_sample_that_is_late_counts_and_those_after_it_catch_up_without_a_burst():
    device, _ = timed(takes_s=1e-4, stalls={12: 0.03})
    block = played(device, ramp(60))
    steps_s = np.diff(block.time_s)
    assert block.late == 10  # 25.2 ms late, 2.5 ms less with each sample, as long as it is more than 2.5 ms
    assert steps_s.max() == pytest.approx(0.02, abs=1e-3)
    assert steps_s[13:].min() == pytest.approx(0.5 / RATE_HZ, rel=1e-6)
    assert block.time_s[-1] - block.time_s[0] == pytest.approx(59 / RATE_HZ, abs=1e-6)


def test_rate_beyond_what_the_link_has_shown_is_refused():
    slow, _ = timed(takes_s=0.005)
    assert slow.promises.highest_rate_hz == pytest.approx(80.0)
    assert slow.promises.latency_s == pytest.approx(0.005)
    with pytest.raises(RangeError, match=r"sample rate 81 Hz: the device offers 0\.001 … 80 Hz"):
        slow.actual_rate_hz(81.0)


def test_blocks_end_by_the_clock_where_samples_come_late():
    device, link = timed()
    link.takes_s = 0.02  # slower than it was when it was opened: 40 ms for a sample, 5 ms are planned
    blocks = list(device.play(ramp(20), 20))  # a block for 0.1 s
    assert [len(block) for block in blocks] == [2] * 10  # a third would end after 0.12 s
    assert joined(blocks).late == 19 and joined(blocks).outputs["a"] == pytest.approx(ramp(20).outputs["a"])
    assert device.promises.sample_s == pytest.approx(0.04)


def test_link_that_falls_behind_says_at_once_how_long_nothing_is_seen():
    device, _ = timed(takes_s=0.001, slow_readings={20: 0.03})
    list(device.play(ramp()))  # its last sample is the slow one
    assert device.promises.blind_s == pytest.approx(0.032)
    played(device, ramp())
    assert device.promises.blind_s == 0.0


def test_whole_waveforms_are_counted_where_blocks_end_early():
    device, link = timed()
    link.takes_s = 0.02
    asked = []

    def waveforms():  # type: ignore[no-untyped-def]
        for i in range(3):
            asked.append(i)
            yield ramp(20)

    blocks = device.stream(waveforms())
    next(blocks)
    assert len(asked) == 2  # one that plays, one ahead
    assert 1 + sum(len(block) for block in blocks) > 57 and len(asked) == 3


def test_link_that_has_become_too_slow_for_its_blocks_ends_the_task_in_words():
    device, link = timed()
    link.takes_s = 0.15
    begun_s = link.clock.now_s
    says = r"too slow: a sample takes 0\.3 s, and may take 0\.05 s where inputs are judged each 0\.1 s"
    with pytest.raises(LinkError, match=says):
        played(device, ramp(400), 20)
    assert link.clock.now_s - begun_s == pytest.approx(1.2)
    device.make_safe()
    assert link.value == -1.0


def test_one_long_stall_does_not_end_a_task():
    device, _ = timed(takes_s=1e-4, stalls={12: 2.0})
    assert len(played(device, ramp(100), 20)) == 100


def test_link_too_slow_for_the_watchdog_of_its_device_is_refused_at_opening():
    with pytest.raises(LinkError, match=r"loop: a sample takes 0\.2 s as measured, too long .* watchdog_s = 0\.2 s"):
        timed(takes_s=0.1, watchdog_s=0.2)
    device, link = timed(takes_s=0.01, watchdog_s=0.5)
    link.takes_s = 0.1  # a busy host: what samples take of late is not what the rate comes from
    played(device, Waveform(5.0, {"a": np.zeros(4)}))
    with pytest.raises(RangeError, match=r"2 Hz: the device offers 2\.5 … 40 Hz, as its link was measured$"):
        device.actual_rate_hz(2.0)


def test_nothing_is_driven_on_after_the_computer_has_slept():
    device, link = timed()
    played(device, ramp())
    count = len(link.written)
    link.clock.slept_s = 5.0  # type: ignore[misc]
    for _ in range(2):
        with pytest.raises(StoppedError, match="the computer slept for 5 s, and where outputs stood"):
            played(device, ramp())
    assert len(link.written) == count
    device.make_safe()
    assert link.value == -1.0


def test_nothing_is_kept_alive_after_the_computer_has_slept():
    clock = VirtualClock()
    link = Loop(keep_alive_s=0.01)
    with closing(PolledDaq({"loop": link}, {"loop": wiring()}, clock)) as device:
        clock.slept_s = 5.0
        clock.sleep_until(1.0)
        time.sleep(0.1)
        assert not link.written
        with pytest.raises(StoppedError, match="slept for 5 s"):
            played(device, ramp())


def test_blocks_before_a_failure_are_handed_over_before_it_is_raised():
    link = Loop()
    device = daq(link)
    blocks = device.play(ramp(40), 10)
    got = [next(blocks)]
    link.failures = [LinkError("no answer")]
    with pytest.raises(LinkError, match="loop: no answer"):
        got += list(blocks)
    assert len(got[0]) <= sum(map(len, got)) < 40
    device.make_safe()
    assert link.value == -1.0 and device.levels == {"a": -1.0}


def test_reader_that_leaves_early_ends_the_task():
    link = Loop()
    blocks = daq(link).play(ramp(400), 10)
    next(blocks)
    blocks.close()  # type: ignore[attr-defined]
    count = len(link.written)
    time.sleep(0.03)
    assert len(link.written) == count < 400


def test_program_that_brings_no_waveform_loses_the_task():
    pause = threading.Event()

    def waveforms():  # type: ignore[no-untyped-def]
        yield ramp(2)
        pause.wait(1.3)
        yield ramp(2)

    with pytest.raises(OutputUnderflowError, match="no sample to drive"):
        list(daq(Loop()).stream(waveforms()))


def test_nothing_is_played_after_outputs_could_not_be_made_safe_until_they_were():
    link = Loop()
    device = daq(link)
    link.failures = [LinkError("no answer")]
    with pytest.raises(DeviceLostError, match=r"^loop: no answer$"):
        device.make_safe()
    with pytest.raises(DeviceLostError):
        next(device.play(ramp()))
    device.make_safe()
    assert link.value == -1.0
    next(device.play(ramp()))
    device.close()
    assert link.closed == 1


def test_one_link_that_is_gone_does_not_keep_the_others_from_safety():
    gone, good = Loop(), Loop()
    device = PolledDaq({"gone": gone, "good": good}, {"gone": wiring("1"), "good": wiring("2")})
    gone.failures = [DeviceLostError("cable pulled")] * 4
    with pytest.raises(DeviceLostError, match="gone: cable pulled"):
        device.make_safe()
    assert good.value == -1.0 and device.levels == {"a1": 1.5, "a2": -1.0}


def test_devices_share_one_time_base():
    clock = VirtualClock()
    links = {"x": Loop(clock=clock), "y": Loop(clock=clock)}
    links["x"].takes_s = links["y"].takes_s = 1e-4
    device = PolledDaq(links, {"x": wiring("1"), "y": wiring("2")}, clock)
    block = played(device, Waveform(RATE_HZ, {"a1": np.full(5, 2.0)}))
    assert (block.outputs["a2"] == 1.5).all() and (block.inputs["b1"] == 2.0).all()
    delays = device.promises.sampling(device.inputs, RATE_HZ)["delay_s"]
    assert 0.0 < delays["b1"] < delays["b2"]


def test_levels_are_driven_again_in_a_pause():
    link = Loop(keep_alive_s=0.02)
    device = daq(link)
    device.make_safe()
    until(lambda: len(link.written) >= 3)
    assert len(link.written) >= 3 and set(link.written) == {-1.0}
    device.close()
    count = len(link.written)
    device.make_safe()
    time.sleep(0.05)
    assert len(link.written) == count
