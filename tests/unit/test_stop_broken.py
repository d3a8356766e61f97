"""Ways to break the stop, planted one at a time: each is noticed by a test that passes otherwise."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from hil.bench import watchdog
from hil.bench.stop import listener
from hil.bench.stop.listener import Listener
from hil.bench.stop.stop_service import OutputStatus, StopService
from hil.record import durable
from hil.safety import guard, operator
from hil.safety.guard import Guard
from hil.safety.operator import Operator
from hil.safety.outputs import Output, Outputs, State
from hil.system.parent import Parent
from tests import stops
from tests.unit import test_safety_operator as by_run
from tests.unit import test_stop_listener as by_listener
from tests.unit import test_stop_watchdog as by_watchdog
from tests.waits import until

pytestmark = pytest.mark.xdist_group("waits for stops")  # for clocks: on one worker, beside others that compute

Patch = pytest.MonkeyPatch

WAITED_FOR_S = 5.0
_TRIES = 3  # a busy machine may be too late to show one


@dataclass(frozen=True, slots=True)
class Broken:
    """A fault, how it is planted, and the test that finds it."""

    fault: str
    plant: Callable[[Patch], None]
    test: Callable[[Patch, Path], None]

    def __str__(self) -> str:
        return self.fault


def instead(where: Any, name: str, other: Any) -> Callable[[Patch], None]:
    return lambda patch: patch.setattr(where, name, other)


def alone(test: Callable[..., None], *values: Any) -> Callable[[Patch, Path], None]:
    return lambda _patch, _folder: test(*values)


def with_patch(test: Callable[..., None], *values: Any) -> Callable[[Patch, Path], None]:
    return lambda patch, _folder: test(*values, monkeypatch=patch)


def with_program(test: Callable[..., None], *values: Any) -> Callable[[Patch, Path], None]:
    def run(patch: Patch, _folder: Path) -> None:
        with by_watchdog.begun(patch) as program:
            test(*values, watched=program)

    return run


def _impatient(patch: Patch) -> None:
    """What a planted fault keeps back for good is not waited for as long as a busy computer takes."""
    for module in (by_run, by_listener, by_watchdog):
        patch.setattr(module, "PATIENCE_S", WAITED_FOR_S)
    patch.setattr(stops, "sent", partial(stops.sent, timeout_s=WAITED_FOR_S))
    patch.setattr(by_listener, "sent", stops.sent)
    patch.setattr(by_watchdog, "until", partial(until, within_s=WAITED_FOR_S))


def _latching(patch: Patch) -> None:
    tell_safe = Guard._tell_safe  # noqa: SLF001 - planted inside

    def and_latch(self: Guard) -> None:
        tell_safe(self)
        if self._operator.stop_asked:
            self.latch.trip({"stop": "pressed"})

    patch.setattr(Guard, "_tell_safe", and_latch)


def _trusting(patch: Patch) -> None:
    def sent_is_safe(self: Outputs, name: str, *_answer: object) -> Output:
        return Output(State.SAFE, self._channels[name].unit, 0.0)

    patch.setattr(Outputs, "_after", sent_is_safe)


def _dying(patch: Patch) -> None:
    import asyncio

    def once(self: Listener) -> None:
        try:
            asyncio.run(self._serve())
        except BaseException:
            return

    patch.setattr(Listener, "_run", once)


def _readable(patch: Patch) -> None:
    opened = os.open
    patch.setattr(durable.os, "open", lambda path, flags, _mode=0, **more: opened(path, flags, 0o644, **more))


def _ramping(patch: Patch) -> None:
    ramp_down = Guard._ramp_down  # noqa: SLF001 - planted inside

    def unasked(self: Guard) -> None:
        with patch.context() as meanwhile:
            meanwhile.setattr(self._operator, "_stop", threading.Event())
            ramp_down(self)

    patch.setattr(Guard, "_ramp_down", unasked)


def _one_is_enough(patch: Patch) -> None:
    for name in ("is_final", "is_confirmed"):
        patch.setattr(OutputStatus, name, property(lambda told: any(o.settled for o in told.outputs.values())))


def _killing_nobody(patch: Patch) -> None:
    patch.setattr(Parent, "kill", lambda _self, _pid: None)


def _no_desk_memory(patch: Patch) -> None:
    patch.setattr(StopService, "forget", lambda _self: None)


def _silent(patch: pytest.MonkeyPatch) -> None:
    """Whoever is given to tell to, an operator tells nothing: neither at the stop nor when the run is over."""
    told = property(lambda _self: lambda _outputs: None, lambda _self, _tell: None)
    patch.setattr(Operator, "tell", told, raising=False)


BROKEN = [
    Broken("the run looks for a stop between parts only, not within a block",
           instead(operator, "halt_main_thread", lambda: False), alone(by_run.test_stop_cuts_a_block_and_jumps, {})),
    Broken("the run drives on after a stop", instead(Operator, "check", lambda _self: None),
           alone(by_run.test_nothing_is_driven_after_a_stop)),
    Broken("a stop goes down the ramp", _ramping, alone(by_run.test_stop_cuts_a_block_and_jumps, by_run.RAMP)),
    Broken("a ramp that has begun is not cut", instead(guard, "cut_by_halt", nullcontext),
           alone(by_run.test_stop_on_the_way_down_makes_it_a_jump)),
    Broken("a stop latches", _latching, alone(by_run.test_stop_cuts_a_block_and_jumps, {})),
    Broken("the run tells nobody that its outputs are safe", _silent,
           alone(by_run.test_stop_cuts_a_block_and_jumps, {})),
    Broken("what was sent is called safe", _trusting, alone(by_run.test_stop_is_told_what_cannot_be_confirmed)),
    Broken("whatever is told is called confirmed", instead(OutputStatus, "is_confirmed", True),
           with_patch(by_listener.test_nothing_but_read_back_safe_is_called_confirmed,
                      Output(State.UNCONFIRMED, "V", can=False))),
    Broken("one safe output confirms them all", _one_is_enough,
           with_patch(by_listener.test_one_of_two_outputs_confirms_nothing)),
    Broken("the answer waits as long as the device does", instead(by_listener, "REAL_ANSWER_S", 2.5),
           with_patch(by_listener.test_stop_that_nobody_confirms_is_answered_so_within_a_second)),
    Broken("any token will do", instead(listener.hmac, "compare_digest", lambda _one, _other: True),
           alone(by_listener.test_wrong_token_moves_nothing)),
    Broken("any page may read the answer", instead(listener, "may_read", lambda _origin: True),
           alone(by_listener.test_answer_may_be_read_by_pages_of_a_console_and_no_others)),
    Broken("connections are taken without end", instead(listener, "_MOST", 100_000),
           alone(by_listener.test_connections_that_say_nothing_do_not_keep_a_stop_waiting, 200)),
    Broken("what ends the listener's thread ends it for good", _dying,
           with_patch(by_listener.test_listener_comes_back_after_whatever_ended_its_thread)),
    Broken("the watchdog waits for the run for ever", instead(watchdog, "CONFIRMS_S", 1e9),
           with_program(by_watchdog.test_program_that_says_it_is_not_safe_is_killed, Output(State.DRIVEN, "V", 5.0))),
    Broken("the watchdog does not kill the run", _killing_nobody,
           with_program(by_watchdog.test_program_that_does_not_confirm_is_killed_after_a_moment)),
    Broken("the run is not told", instead(watchdog, "REQUESTS", {"stop": b"", "hold": b"", "resume": b""}),
           with_program(by_watchdog.test_program_that_does_not_confirm_is_killed_after_a_moment)),
    Broken("what a dead run said still counts", _no_desk_memory,
           alone(by_listener.test_desk_forgets_what_a_dead_run_said)),
    Broken("others may read the token", _readable,
           lambda _patch, folder: by_watchdog.test_control_file_is_its_owners_and_goes_with_the_run(folder)),
]  # fmt: skip


@pytest.mark.parametrize("broken", BROKEN, ids=str)
def test_break_is_noticed(broken, monkeypatch, tmp_path):
    with monkeypatch.context() as patch:
        _impatient(patch)
        broken.plant(patch)
        assert any(_is_noticed(broken, patch, tmp_path) for _ in range(_TRIES))


def _is_noticed(broken: Broken, patch: Patch, folder: Path) -> bool:
    try:
        broken.test(patch, folder)
    except (AssertionError, IndexError, OSError, pytest.fail.Exception):
        return True
    return False
