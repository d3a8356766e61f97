"""Signals never interrupt the way to a safe state."""

from __future__ import annotations

import signal
import threading
from contextlib import suppress

import pytest

from hil.errors import LinkError, StoppedError
from hil.safety.interrupt import (
    Terminated,
    begin_ending,
    ended_by,
    ignore_signals,
    notified_of_signals,
    status_of,
    terminable,
    uninterrupted,
)


def hold_back(number: signal.Signals, reached: list[str]) -> None:
    with terminable():
        with uninterrupted():
            signal.raise_signal(number)
            signal.raise_signal(number)
            reached.append("safe")
        reached.append("the signal was lost")


def hold_back_twice(reached: list[str]) -> None:
    with uninterrupted():
        with uninterrupted():
            signal.raise_signal(signal.SIGINT)
        reached.append("still inside")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_inside_takes_effect_afterwards(number):
    reached = []
    with pytest.raises(KeyboardInterrupt):
        hold_back(number, reached)
    assert reached == ["safe"]


def test_signal_inside_a_nested_section_waits_for_the_outer_one():
    reached = []
    with pytest.raises(KeyboardInterrupt):
        hold_back_twice(reached)
    assert reached == ["still inside"]


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGQUIT, signal.SIGTERM])
def test_every_request_to_end_is_an_exception_with_its_number(number):
    before = signal.getsignal(number)
    with pytest.raises(Terminated, match=number.name) as raised, terminable():
        signal.raise_signal(number)
    assert raised.value.number == number and status_of(raised.value) == 128 + number
    assert signal.getsignal(number) is before


def fail_while_signals_come(reached: list[str]) -> None:
    with terminable():
        begin_ending()
        signal.raise_signal(signal.SIGTERM)
        reached.append("nothing is raised on the way out")
        raise StoppedError("first")


def test_error_on_its_way_is_not_replaced_by_a_signal():
    reached = []
    with pytest.raises(StoppedError, match="first"):
        fail_while_signals_come(reached)
    assert reached


def end_well_while_a_signal_comes(reached: list[str]) -> None:
    with terminable():
        begin_ending()
        signal.raise_signal(signal.SIGHUP)
        reached.append("safe")


def test_signal_that_came_on_the_way_out_of_a_good_end_is_raised_then():
    reached = []
    with pytest.raises(Terminated):
        end_well_while_a_signal_comes(reached)
    assert reached == ["safe"]


def test_signal_that_somebody_swallows_was_told_before():
    heard = []
    with terminable(), notified_of_signals(heard.append), suppress(KeyboardInterrupt):
        signal.raise_signal(signal.SIGTERM)
    assert [status_of(error) for error in heard] == [128 + signal.SIGTERM]


def test_what_is_ignored_stays_ignored():
    signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup has it
    with terminable():
        signal.raise_signal(signal.SIGHUP)


def end_as_the_program_does() -> str:
    with terminable():
        begin_ending()
        signal.raise_signal(signal.SIGTERM)
        ignore_signals()
    signal.raise_signal(signal.SIGINT)
    return "its status is said"


def test_nothing_changes_the_status_once_it_is_said():
    assert end_as_the_program_does() == "its status is said"


def test_other_threads_have_no_signals_to_hold():
    ran = []

    def work():
        with terminable(), uninterrupted():
            ran.append(1)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert ran == [1]


def test_ended_by_a_signal_that_a_library_made_its_own_error_of():
    bug, refused = ImportError("initialization failed"), LinkError("no answer")
    assert ended_by(bug) is bug
    with pytest.raises(Terminated), terminable():  # noqa: PT012  # the signal comes inside
        try:
            signal.raise_signal(signal.SIGTERM)
        except KeyboardInterrupt:
            assert isinstance(ended_by(bug), Terminated) and ended_by(refused) is refused
            raise
