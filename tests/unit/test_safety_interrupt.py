"""Signals never interrupt the way to a safe state."""

from __future__ import annotations

import signal
import threading

import pytest

from hil.safety.interrupt import Terminated, terminable, uninterrupted


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
def test_signal_inside_takes_effect_afterwards(number: signal.Signals) -> None:
    reached: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        hold_back(number, reached)
    assert reached == ["safe"]


def test_signal_inside_a_nested_section_waits_for_the_outer_one() -> None:
    reached: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        hold_back_twice(reached)
    assert reached == ["still inside"]


def test_sigterm_is_an_exception_and_the_handler_comes_back() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(Terminated), terminable():
        signal.raise_signal(signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) is before


def test_other_threads_have_no_signals_to_hold() -> None:
    ran = []

    def work() -> None:
        with terminable(), uninterrupted():
            ran.append(1)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert ran == [1]
