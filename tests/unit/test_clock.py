"""The host's clock: what it tells of a sleep, and that a step of the wall clock is none."""

import signal
import threading
import time

import pytest

from hil.clock import Flag, RealClock, VirtualClock, refuse_after_sleep
from hil.errors import StoppedError
from hil.system import system

pytestmark = pytest.mark.skipif(not hasattr(time, "CLOCK_BOOTTIME"), reason="nothing tells of a sleep here")


def test_a_sleep_is_what_the_monotonic_clock_has_missed(monkeypatch):
    clock, monotonic = RealClock(), system.now_s
    assert clock.slept_s == 0.0
    monkeypatch.setattr(system, "now_s", lambda: monotonic() - 5.0)
    assert clock.slept_s > 4.5
    with pytest.raises(StoppedError, match="the computer slept for"):
        refuse_after_sleep(clock)
    assert RealClock().slept_s == 0.0


def test_a_step_of_the_wall_clock_is_no_sleep(monkeypatch):
    clock, wall = RealClock(), time.time
    monkeypatch.setattr(time, "time", lambda: wall() + 3600.0)
    assert clock.slept_s == 0.0
    refuse_after_sleep(clock)


def test_a_look_that_takes_long_is_no_sleep(monkeypatch):
    clock, monotonic = RealClock(), system.now_s

    def held_up():
        time.sleep(0.2)
        return monotonic()

    monkeypatch.setattr(system, "now_s", held_up)
    assert clock.slept_s == 0.0


def test_where_nothing_tells_nothing_is_said(monkeypatch):
    monkeypatch.delattr(time, "CLOCK_BOOTTIME")
    refuse_after_sleep(RealClock())
    refuse_after_sleep(VirtualClock())


def test_flag_is_waited_for_and_taken_back():
    flag = Flag()
    assert not flag.wait(0.0)
    threading.Timer(0.02, flag.set).start()
    assert flag.wait(600.0) and flag.wait(0.0) and flag.is_set()
    flag.clear()
    assert not flag.is_set() and not flag.wait(0.001)


def test_no_signal_leaves_a_flag_locked():
    """An event of the library is locked for ever after a few of these."""
    flag, came = Flag(), 0

    def stop(*_):
        raise InterruptedError

    before = signal.signal(signal.SIGALRM, stop)
    try:
        while came < 200:
            try:
                signal.setitimer(signal.ITIMER_REAL, 3e-5)
                while True:
                    flag.set()
            except InterruptedError:
                came += 1
                flag.clear()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    waits = threading.Thread(target=flag.wait, args=(0.01,), daemon=True)
    waits.start()
    waits.join(600.0)
    assert not waits.is_alive()
