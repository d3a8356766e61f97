"""The loop that polls links: stamps, lateness, pauses, failures."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping

import numpy as np
import pytest

from hil.daq.channel import InputChannel, OutputChannel, Wiring
from hil.daq.contract import Waveform, joined
from hil.daq.polled import PolledDaq
from hil.errors import DeviceLostError, LinkError, OutputUnderflowError

RATE_HZ = 200.0


class Loop:
    """A link whose one input reads its one output; it can be told to be slow, to fail, or to be gone."""

    watchdog_s: float | None = None

    def __init__(self, keep_alive_s: float | None = None) -> None:
        self.keep_alive_s = keep_alive_s
        self.value, self.takes_s = 1.5, 0.0
        self.failures: list[Exception] = []
        self.stalls: dict[int, float] = {}
        self.written: list[float] = []
        self.closed = 0

    def standing(self) -> Mapping[str, float]:
        time.sleep(self.takes_s)
        return {"out": self.value}

    def drive(self, values: Mapping[str, float]) -> None:
        self._happen()
        time.sleep(self.stalls.pop(len(self.written), 0.0))
        self.value = values["out"]
        self.written.append(self.value)

    def read(self) -> Mapping[str, float]:
        self._happen()
        return {"in": self.value}

    def close(self) -> None:
        self.closed += 1

    def _happen(self) -> None:
        time.sleep(self.takes_s)
        if self.failures:
            raise self.failures.pop(0)


def wiring(suffix: str = "") -> Wiring:
    return Wiring(
        {f"a{suffix}": OutputChannel(f"a{suffix}", "out", "voltage", "V", -10.0, 10.0, safe=-1.0)},
        {f"b{suffix}": InputChannel(f"b{suffix}", "in", "voltage", "V", -10.0, 10.0)},
    )


def daq(link: Loop) -> PolledDaq:
    return PolledDaq({"loop": link}, {"loop": wiring()})


def ramp(samples: int = 20) -> Waveform:
    return Waveform(RATE_HZ, {"a": np.linspace(0.0, 2.0, samples)})


def test_outputs_are_told_where_they_were_found() -> None:
    assert daq(Loop()).levels == {"a": 1.5}


def test_each_sample_is_driven_then_read_and_has_the_stamp_it_had() -> None:
    begun_s = time.monotonic()
    block = joined(list(daq(Loop()).play(ramp(), 7)))
    assert np.array_equal(block.inputs["b"], block.outputs["a"])
    assert np.array_equal(block.outputs["a"], ramp().outputs["a"])
    assert (np.diff(block.time_s) > 0.3 / RATE_HZ).all()
    assert 19 / RATE_HZ < block.time_s[-1] < time.monotonic() - begun_s


def test_stream_asks_for_the_next_waveform_while_one_plays() -> None:
    link, seen = Loop(), []

    def waveforms():  # type: ignore[no-untyped-def]
        for _ in range(3):
            seen.append(len(link.written))
            yield ramp(10)

    assert [len(block) for block in daq(link).stream(waveforms())] == [10, 10, 10]
    assert seen[1] < 10 and 10 <= seen[2] < 20 + 10


def test_sample_that_is_late_counts_and_those_after_it_catch_up_without_a_burst() -> None:
    link = Loop()
    link.stalls = {12: 0.03}
    block = joined(list(daq(link).play(ramp(60))))
    steps_s = np.diff(block.time_s)
    assert block.late >= 1
    assert steps_s.max() > 0.015 and (steps_s > 0.3 / RATE_HZ).all()
    assert block.time_s[-1] - block.time_s[0] == pytest.approx(59 / RATE_HZ, abs=0.03)


def test_rate_beyond_what_the_link_has_shown_is_refused() -> None:
    link = Loop()
    link.takes_s = 0.005
    slow = daq(link)
    assert slow.promises.highest_rate_hz < 100.0
    assert slow.promises.latency_s == pytest.approx(0.005, rel=0.5)


def test_blocks_before_a_failure_are_handed_over_before_it_is_raised() -> None:
    link = Loop()
    device = daq(link)
    blocks = device.play(ramp(40), 10)
    got = [next(blocks)]
    link.failures = [LinkError("no answer")]
    with pytest.raises(LinkError, match="loop: no answer"):
        got += list(blocks)
    assert 10 <= sum(map(len, got)) < 40
    device.make_safe()
    assert link.value == -1.0 and device.levels == {"a": -1.0}


def test_reader_that_leaves_early_ends_the_task() -> None:
    link = Loop()
    blocks = daq(link).play(ramp(400), 10)
    next(blocks)
    blocks.close()  # type: ignore[attr-defined]
    count = len(link.written)
    time.sleep(0.03)
    assert len(link.written) == count < 400


def test_program_that_brings_no_waveform_loses_the_task() -> None:
    pause = threading.Event()

    def waveforms():  # type: ignore[no-untyped-def]
        yield ramp(2)
        pause.wait(1.3)
        yield ramp(2)

    with pytest.raises(OutputUnderflowError, match="no sample to drive"):
        list(daq(Loop()).stream(waveforms()))


def test_safe_is_tried_twice_then_says_where_outputs_stand() -> None:
    link = Loop()
    device = daq(link)
    link.failures = [LinkError("no answer")]
    device.make_safe()
    assert link.value == -1.0
    link.failures = [LinkError("no answer"), LinkError("no answer")]
    with pytest.raises(
        DeviceLostError, match=r"cannot be reached and stand where they stood \(a at -1\): use the emerg"
    ):
        device.make_safe()
    with pytest.raises(DeviceLostError):
        next(device.play(ramp()))
    device.close()
    assert link.closed == 1


def test_one_link_that_is_gone_does_not_keep_the_others_from_safety() -> None:
    gone, good = Loop(), Loop()
    device = PolledDaq({"gone": gone, "good": good}, {"gone": wiring("1"), "good": wiring("2")})
    gone.failures = [DeviceLostError("cable pulled")] * 4
    with pytest.raises(DeviceLostError, match="gone: cable pulled"):
        device.make_safe()
    assert good.value == -1.0 and device.levels == {"a1": 1.5, "a2": -1.0}


def test_devices_share_one_time_base() -> None:
    device = PolledDaq({"x": Loop(), "y": Loop()}, {"x": wiring("1"), "y": wiring("2")})
    block = joined(list(device.play(Waveform(RATE_HZ, {"a1": np.full(5, 2.0)}))))
    assert (block.outputs["a2"] == 1.5).all() and (block.inputs["b1"] == 2.0).all()
    delays = device.promises.sampling(device.inputs, RATE_HZ)["delay_s"]
    assert 0.0 < delays["b1"] < delays["b2"]


def test_levels_are_driven_again_in_a_pause() -> None:
    link = Loop(keep_alive_s=0.02)
    device = daq(link)
    device.make_safe()
    time.sleep(0.15)
    assert len(link.written) >= 3 and set(link.written) == {-1.0}
    device.close()
    count = len(link.written)
    device.make_safe()
    time.sleep(0.05)
    assert len(link.written) == count
