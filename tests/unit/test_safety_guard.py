"""The guard: every way out of a task leads over the safe values."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from wire import Wire

from hil.clock import VirtualClock
from hil.daq.contract import Waveform
from hil.errors import HardwareError, RangeError, StoppedError, StorageError, TrippedError
from hil.safety.envelope import Dwell, Envelope
from hil.safety.guard import Guard
from hil.safety.interlock import Action, Band, Interlock
from hil.safety.latch import Latch
from hil.safety.protection import Protection
from tests.driven import played

RATE_HZ = 100.0
LIMITS = {"a": Envelope(-8.0, 8.0)}


def high(action: Action, limit: float = 6.0) -> Interlock:
    return Interlock("high", action, Band("a read", high=limit))


def wave(*levels: float, samples: int = 10) -> Waveform:
    return Waveform(RATE_HZ, {"a": np.repeat(levels, samples)})


def protection(*interlocks: Interlock, ramps: dict[str, float] | None = None, **more: Any) -> Protection:
    return Protection(RATE_HZ, LIMITS, ramps or {}, interlocks, **{"block_s": 0.1, **more})


def guarded(*interlocks: Interlock, **more: Any) -> tuple[Wire, Guard]:
    wire = Wire()
    return wire, Guard(wire, protection(*interlocks, **more))


def driven(wire: Wire) -> list[float]:
    return [value for value, _ in wire.log["a"]]


def test_waveform_is_checked_whole_before_its_first_sample():
    wire, guard = guarded()
    with pytest.raises(RangeError, match="sample 20"):
        played(guard, wave(5.0, 5.0, 9.0))
    assert 5.0 not in driven(wire)


def test_interlocks_are_judged_before_anything_moves():
    wire = Wire()
    wire.offset = 7.0
    with pytest.raises(TrippedError, match="high"):
        list(Guard(wire, protection(high("trip"))).play(wave(1.0)))
    assert set(driven(wire)) == {0.0}


def test_trip_makes_safe_within_the_block_and_latches():
    wire, guard = guarded(high("trip"), ramps={"a": 10.0})
    with pytest.raises(
        TrippedError, match=r"'high': 7; allowed: a read ≤ 6 at 0\.250 s; find the cause; this trip ends with its run"
    ):
        played(guard, wave(1.0, 7.0, 7.0, 7.0, samples=15))
    assert driven(wire)[-1] == 0.0 and driven(wire)[-2] == 7.0  # a jump, whatever the ramp
    assert driven(wire).count(7.0) == 5  # the rest of its block
    with pytest.raises(TrippedError):
        played(guard, wave(0.5))
    guard.latch.reset("high")
    with pytest.raises(TrippedError, match="'high': 7"):  # the run is over all the same
        played(guard, wave(0.5))


def test_stop_goes_down_the_ramp():
    wire, guard = guarded(high("stop"), ramps={"a": 100.0})
    with pytest.raises(StoppedError, match="the run was stopped"):
        played(guard, wave(7.0))
    assert driven(wire)[-7:] == pytest.approx([6.0, 5.0, 4.0, 3.0, 2.0, 1.0, 0.0])
    assert not guard.latch.trips


def test_trip_on_the_way_down_jumps():
    wire = Wire()
    low = Interlock("low", "trip", Band("a read", low=3.0), only_while=Band("a", high=2.5))
    guard = Guard(wire, protection(low, ramps={"a": 10.0}))
    wire.offset = 5.0
    played(guard, wave(7.0))
    wire.offset = 0.0
    with pytest.raises(TrippedError, match="low"):
        guard.close()
    steps = np.diff(driven(wire)[-3:])
    assert steps[-1] < -1.5 and wire.levels["a"] == 0.0
    assert wire.closed == 1


def test_hold_waits_before_the_next_part_until_the_condition_is_met():
    wire = Wire()
    kept = []

    def keep(block):
        kept.append(block)
        wire.offset = -3.0 if len(kept) > 4 else 0.0  # it cools down while the guard waits

    guard = Guard(wire, protection(high("hold"), patience_s=10.0), keep=keep)
    played(guard, wave(7.0))
    played(guard, wave(7.5))
    assert driven(wire) == [0.0] * 10 + [7.0] * (10 + 40) + [7.5] * 10


def test_hold_does_not_wait_longer_than_an_output_may_dwell():
    wire = Wire()
    limits = {"a": Envelope(-8.0, 8.0, dwells=(Dwell(5.0, 1.0),))}
    guard = Guard(wire, Protection(RATE_HZ, limits, {}, (high("hold"),), block_s=0.1))
    played(guard, wave(7.0))
    with pytest.raises(RangeError, match="beyond ±5"):
        played(guard, wave(0.0))
    assert driven(wire).count(7.0) == 100
    assert wire.levels["a"] == 0.0


def test_hold_gives_up_when_patience_ends():
    wire, guard = guarded(high("hold"), patience_s=0.5)
    played(guard, wave(7.0))
    with pytest.raises(StoppedError, match=r"held the run for 0\.5 s"):
        played(guard, wave(7.0))
    assert wire.levels["a"] == 0.0


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError, MemoryError])
def test_any_error_of_the_reader_makes_safe(error):
    wire = Wire()

    def read():
        for _ in Guard(wire, protection(ramps={"a": 100.0})).play(wave(5.0, samples=30)):
            raise error

    with pytest.raises(error):
        read()
    assert driven(wire)[-5:] == pytest.approx([4.0, 3.0, 2.0, 1.0, 0.0])


def test_reader_who_leaves_early_makes_safe():
    wire = Wire()
    blocks = Guard(wire, protection()).stream(wave(5.0) for _ in range(100))
    next(blocks)
    blocks.close()
    assert wire.levels["a"] == 0.0


def test_a_trip_on_the_way_down_ends_the_run_of_a_reader_who_left_early():
    wire, guard = guarded(high("trip"), ramps={"a": 10.0})
    blocks = guard.stream(wave(5.0) for _ in range(100))
    next(blocks)
    wire.offset = 4.0
    blocks.close()
    assert isinstance(guard.over, TrippedError) and wire.levels["a"] == 0.0
    with pytest.raises(TrippedError, match="high"):
        played(guard, wave(0.0))


def test_a_trip_waits_for_no_disk_and_its_block_is_kept():
    wire, kept, stood = Wire(), [], []

    def slowly(block):
        stood.append(driven(wire)[-1])
        kept.append(block)

    guard = Guard(wire, protection(high("trip")), keep=slowly)
    with pytest.raises(TrippedError):
        played(guard, wave(5.0, 7.0))
    assert stood[-2:] == [5.0, 0.0] and kept[-1].inputs["a read"].max() == 7.0


def test_a_trip_that_a_full_disk_cannot_record_is_latched_and_said():
    def full(block):
        if block.inputs["a read"].max() > 6.0:
            raise StorageError("disk full")

    guard = Guard(Wire(), protection(high("trip")), keep=full)
    with pytest.raises(TrippedError, match="'high': 7"):
        played(guard, wave(5.0, 7.0))
    assert guard.latch.trips


def test_block_of_a_trip_that_cannot_be_latched_on_disk_is_kept(tmp_path):
    kept = []
    guard = Guard(Wire(), protection(high("trip")), Latch(tmp_path / "folder" / "trips.json"), keep=kept.append)
    (tmp_path / "folder").touch()  # no folder
    with pytest.raises(StorageError, match="the trips cannot be kept"):
        played(guard, wave(5.0, 7.0))
    assert kept[-1].inputs["a read"].max() == 7.0 and guard.latch.trips


def test_a_trip_goes_before_a_stop_of_its_block_and_both_are_recorded():
    noted = []
    locks = high("stop", 6.0), replace(high("trip", 6.5), name="higher")
    guard = Guard(Wire(), protection(*locks), note=lambda event, **_details: noted.append(event))
    with pytest.raises(TrippedError, match="higher"):
        played(guard, wave(5.0, 7.0))
    assert noted == ["stop", "trip"]


def test_full_disk_does_not_keep_outputs_from_going_safe():
    wire = Wire()

    def full(block):
        if block.outputs["a"].any():
            raise StorageError("disk full")

    with pytest.raises(StorageError):
        list(Guard(wire, protection(ramps={"a": 10.0}), keep=full).play(wave(3.0)))
    assert driven(wire)[-30:] == pytest.approx(np.linspace(2.9, 0.0, 30))


def test_ramp_that_fails_becomes_a_jump():
    class Broken(Wire):
        broken = False

        def play(self, waveform, block_samples=None):
            if self.broken:
                raise HardwareError("no answer")
            return super().play(waveform, block_samples)

    wire, events = Broken(), []
    guard = Guard(wire, protection(ramps={"a": 100.0}), note=lambda event, **_: events.append(event))
    played(guard, wave(3.0))
    wire.broken = True
    guard.make_safe()
    assert wire.levels["a"] == 0.0
    assert events == ["ramp to safe failed"]


def test_outputs_jump_to_safe_after_a_sleep_of_the_computer():
    wire, clock = Wire(), VirtualClock()
    guard = Guard(wire, protection(ramps={"a": 10.0}), clock=clock)
    blocks = guard.play(wave(5.0, samples=30))
    next(blocks)
    clock.slept_s = 5.0
    with pytest.raises(StoppedError, match="the computer slept for 5 s"):
        next(blocks)
    assert wire.levels["a"] == 0.0 and wire.log["a"][-2:] == [(5.0, RATE_HZ), (0.0, None)]


def test_a_trip_in_the_block_after_a_sleep_is_what_ends_the_run():
    wire, clock = Wire(), VirtualClock()
    guard = Guard(wire, protection(high("trip")), clock=clock)
    blocks = guard.play(wave(5.0, 7.0, samples=10))
    next(blocks)
    clock.slept_s = 5.0
    with pytest.raises(TrippedError, match="'high': 7"):
        next(blocks)
    assert wire.levels["a"] == 0.0


def test_way_down_takes_its_time_and_no_longer_on_a_link_that_has_become_slow():
    wire, guard = guarded(ramps={"a": 5.0})
    played(guard, wave(5.0))
    wire.promises = replace(Wire.promises, sample_s=0.05)
    guard.close()
    assert wire.log["a"][-10:] == [(pytest.approx(5.0 - 0.5 * i), 10.0) for i in range(1, 11)]


def test_sample_rate_with_less_than_a_sample_in_a_block_is_refused():
    guard = Guard(Wire(), protection(block_s=0.1))
    assert guard.actual_rate_hz(10.0) == 10.0
    with pytest.raises(RangeError, match=r"sample rate 9 Hz: a sample each 0\.1111 s, and block_s = 0\.1 s promises"):
        guard.actual_rate_hz(9.0)


@pytest.mark.parametrize(("limits", "what"), [(Envelope(1.0, 8.0), "safe value"), (Envelope(-1.0, 2.0), "present")])
def test_tightening_never_leaves_out_where_an_output_is_or_must_go(limits, what):
    guard = Guard(Wire(), protection())
    played(guard, wave(3.0))
    with pytest.raises(RangeError, match=what):
        guard.tighten("a", limits)


@pytest.mark.parametrize("is_driving", [False, True])
def test_dwell_goes_on_while_nothing_plays_and_time_that_is_driven_does_not_count_twice(is_driving):
    clock = VirtualClock()
    limits = {"a": Envelope(-8.0, 8.0, dwells=(Dwell(5.0, 1.0),))}

    def goes_on(_):
        if is_driving:
            clock.sleep_until(clock.now_s + 0.1)

    guard = Guard(Wire(), Protection(RATE_HZ, limits, block_s=0.1), clock=clock, keep=goes_on)
    played(guard, wave(6.0, samples=50))
    guard.check(wave(6.0, samples=50))
    with pytest.raises(RangeError, match="beyond ±5"):
        guard.check(wave(6.0, samples=51))
    clock.sleep_until(clock.now_s + 0.2)
    for drive in (guard.check, partial(played, guard)):
        with pytest.raises(RangeError, match="beyond ±5"):
            drive(wave(6.0, samples=50))


def test_slew_counts_from_where_an_output_really_stands():
    limits = {"a": Envelope(-8.0, 8.0, slew_per_s=100.0)}
    guard = Guard(Wire(), Protection(RATE_HZ, limits, block_s=0.1))
    up = np.linspace(0.0, 5.0, 51)
    blocks = guard.play(Waveform(RATE_HZ, {"a": up}))
    next(blocks)
    blocks.close()  # cut short: the output is safe, whatever was to come
    guard.check(Waveform(RATE_HZ, {"a": up}))
    with pytest.raises(RangeError, match="from 0 to 5 V"):
        guard.check(wave(5.0))


def test_trip_outlives_the_program(tmp_path):
    path = tmp_path / "trips.json"
    with pytest.raises(TrippedError):
        list(Guard(Wire(), protection(high("trip")), Latch(path)).play(wave(7.0)))
    guard = Guard(Wire(), protection(high("trip")), Latch(path))
    with pytest.raises(TrippedError, match="high"):
        played(guard, wave(0.0))
    guard.latch.reset("high")
    assert len(list(Guard(Wire(), protection(high("trip")), Latch(path)).play(wave(0.0)))) == 1
