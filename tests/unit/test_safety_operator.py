"""A stop and a hold that are asked for from outside, as the guard hears them."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager

import numpy as np
import pytest
from wire import Wire

from hil.clock import RealClock
from hil.daq.contract import Waveform
from hil.daq.polled import PolledDaq
from hil.errors import StoppedError
from hil.safety.guard import Guard
from hil.safety.interrupt import Halted, Terminated, terminable
from hil.safety.latch import Latch
from hil.safety.operator import Operator
from hil.safety.outputs import Outputs
from hil.safety.protection import Protection
from tests.driven import played
from tests.stops import WIRING, Remote
from tests.waits import PATIENCE_S

RATE_HZ, BLOCK_S, BUSY_S = 100.0, 8.0, 6.0  # a computer that does other things besides may add seconds
RAMP = {"valve": 0.5}  # V/s: from 5 V it takes 10 s


@contextmanager
def guarded(remote: Remote, ramps: dict[str, float], operator: Operator, latch: Latch | None = None) -> Iterator[Guard]:
    daq = PolledDaq({"remote": remote}, {"remote": WIRING})
    with closing(
        Guard(daq, Protection(RATE_HZ, {}, ramps, (), BLOCK_S), latch, RealClock(), operator=operator)
    ) as guard:
        yield guard


def later(after_s: float, do: Callable[[], object]) -> threading.Thread:
    thread = threading.Timer(after_s, do)
    thread.start()
    return thread


class Pressing(Remote):
    """Somebody presses stop as soon as it stands at a level, however late a busy computer brings it there.

    Attributes:
        asked_s: when that was.
    """

    def __init__(self, operator: Operator, is_there: Callable[[float], bool], deaf: bool = False) -> None:
        super().__init__(deaf)
        self._operator, self._is_there = operator, is_there
        self.asked_s = 0.0

    def drive(self, values: Mapping[str, float]) -> None:
        super().drive(values)
        if not self.asked_s and self._is_there(self.at):
            self.asked_s = time.monotonic()
            self._operator.ask("stop")

    @property
    def safe_s(self) -> float:
        """How long after that it was commanded safe."""
        return min(at_s for at_s, value in self.given if at_s > self.asked_s and value == 0.0) - self.asked_s


def halted(
    remote: Remote, ramps: dict[str, float], operator: Operator, samples: int, latch: Latch | None = None
) -> Outputs:
    """What is known of the output after a run at 5 V that somebody stopped."""
    try:
        with terminable(), guarded(remote, ramps, operator, latch) as guard:
            played(guard, Waveform(RATE_HZ, {"valve": np.full(samples, 5.0)}))
    except Halted:
        return guard.output_states
    raise AssertionError("the run was not stopped")


@pytest.mark.parametrize("ramps", [{}, RAMP], ids=["jump", "ramp"])
def test_stop_cuts_a_block_and_jumps(ramps):
    operator, latch = Operator(), Latch()
    told = []
    operator.tell = lambda known: told.append((time.monotonic(), known.are_safe))
    remote = Pressing(operator, lambda level: level == 5.0)
    known = halted(remote, ramps, operator, 2000, latch)
    assert {value for _, value in remote.given} <= {0.0, 5.0}, "no ramp"
    assert remote.safe_s < BUSY_S, "not at the end of the block"
    assert told[0][1] and told[0][0] - remote.asked_s < BUSY_S
    assert known.are_safe and not latch.trips


def test_stop_on_the_way_down_makes_it_a_jump():
    operator = Operator()
    remote = Pressing(operator, lambda level: 0.0 < level < 5.0)
    known = halted(remote, RAMP, operator, 10)
    assert remote.safe_s < BUSY_S, "the ramp would have taken ten seconds"
    assert known.are_safe and remote.at == 0.0


def test_stop_ends_an_endless_loop():
    remote, operator = Remote(), Operator()

    def run():
        with terminable(), guarded(remote, {}, operator) as guard:
            played(guard, Waveform(RATE_HZ, {"valve": np.full(10, 5.0)}))
            timers.append(later(0.1, lambda: operator.ask("stop")))
            while True:
                pass

    timers = []
    with pytest.raises(Halted):
        run()
    timers[0].join()
    assert remote.at == 0.0 and 5.0 in [value for _, value in remote.given]


def test_nothing_is_driven_after_a_stop():
    wire, operator = Wire(), Operator()
    guard = Guard(wire, Protection(100.0), operator=operator)
    operator.ask("stop")
    for _ in range(2):
        with pytest.raises(Halted):
            played(guard, Waveform(100.0, {"a": np.full(5, 3.0)}))
        with pytest.raises(Halted):
            list(guard.stream([Waveform(100.0, {"a": np.full(5, 3.0)})]))
    assert wire.log["a"] == []
    with pytest.raises(Halted):
        guard.close()
    assert wire.closed


def test_run_in_another_thread_is_stopped_at_its_next_block():
    remote, ended = Remote(), []

    def drive():
        daq = PolledDaq({"remote": remote}, {"remote": WIRING})
        mine.append(Operator())
        guard = Guard(daq, Protection(RATE_HZ, {}, {}, (), 0.1), None, RealClock(), operator=mine[0])
        try:
            played(guard, Waveform(RATE_HZ, {"valve": np.full(500, 5.0)}))
        except Halted as halted:
            ended.append(halted)
        finally:
            with pytest.raises(Halted):
                guard.close() if not ended else mine[0].check()
            daq.close()

    mine = []
    thread = threading.Thread(target=drive)
    thread.start()
    while remote.at != 5.0:
        time.sleep(0.005)
    mine[0].ask("stop")
    thread.join(PATIENCE_S)
    assert ended and remote.at == 0.0 and len(remote.given) < 500


def test_stop_is_told_what_cannot_be_confirmed():
    operator = Operator()
    told = []
    operator.tell = lambda known: told.append(known.by_name["valve"].state)
    known = halted(Pressing(operator, lambda level: level == 5.0, deaf=True), {}, operator, 300)
    assert told[0] == "driven" and not known.settled


def test_status_of_a_stop_is_its_own():
    known = Outputs()
    assert known.status(Halted(), 2) == 138 and isinstance(Halted(), Terminated)


def test_hold_waits_at_the_border_and_goes_on():
    remote, operator, noted = Remote(), Operator(), []
    holding = []
    operator.holding = holding.append
    daq = PolledDaq({"remote": remote}, {"remote": WIRING})
    guard = Guard(
        daq, Protection(RATE_HZ, {}, {}, (), 0.05), None, RealClock(), operator=operator,
        note=lambda event, **details: noted.append(event),
    )  # fmt: skip
    played(guard, Waveform(RATE_HZ, {"valve": np.full(3, 5.0)}))
    operator.ask("hold")
    begun_s, resumed_s = time.monotonic(), []

    def resume():
        resumed_s.append(time.monotonic())
        operator.ask("resume")

    timer = later(2.0, resume)
    played(guard, Waveform(RATE_HZ, {"valve": np.full(3, 4.0)}))
    timer.join()
    held = [value for at_s, value in remote.given if begun_s < at_s < resumed_s[0]]
    guard.close()
    assert held and set(held) == {5.0}, "it stands where it stood"
    assert 4.0 in [value for _, value in remote.given]
    assert noted == ["hold", "resume"] and holding == [True, False]


def test_hold_of_virtual_time_waits_on_the_wall_clock_and_a_stop_ends_it():
    wire, operator = Wire(), Operator()
    guard = Guard(wire, Protection(100.0), operator=operator)
    operator.ask("hold")
    timer = later(0.1, lambda: operator.ask("stop"))
    begun_s = time.monotonic()
    with pytest.raises(Halted):
        played(guard, Waveform(100.0, {"a": np.full(5, 3.0)}))
    timer.join()
    assert time.monotonic() - begun_s >= 0.09 and 3.0 not in [value for value, _ in wire.log["a"]]


def test_hold_is_not_waited_for_longer_than_patience():
    operator = Operator()
    guard = Guard(Wire(), Protection(100.0, patience_s=0.1), operator=operator)
    operator.ask("hold")
    with pytest.raises(StoppedError, match=r"the operator held the run for 0\.1 s"):
        played(guard, Waveform(100.0, {"a": np.full(5, 3.0)}))


def test_who_asked_for_a_stop_is_answered_before_it_is_said_that_nothing_is_driven():
    """Between the two the watchdog would take a run for one that does not confirm, and kill it."""
    said = []
    operator = Operator()
    operator.confirming = lambda: said.append("confirming")
    operator.tell = lambda known: said.append(f"told {known.settled}")
    beat = {True: "driven", False: "safe"}
    guard = Guard(
        Wire(levels={"a": 5.0}), Protection(RATE_HZ), beat=lambda driven: said.append(beat[driven]), operator=operator
    )
    assert said[0] == "confirming" and said[-1] == "safe"
    said.clear()
    operator.ask("stop")
    guard.make_safe()
    assert said[0] == "confirming" and said[-2:] == ["told True", "safe"]


def test_stop_that_is_pressed_when_a_run_is_over_has_its_answer():
    told = []
    operator = Operator()
    operator.tell = lambda known: told.append(known.settled)
    guard = Guard(Wire(levels={"a": 5.0}), Protection(RATE_HZ), operator=operator)
    guard.make_safe()
    assert not told
    guard.close()
    assert told == [True]
