"""Real time, or virtual time that moves only when somebody waits."""

from __future__ import annotations

import time
from dataclasses import dataclass
from threading import Event
from typing import Literal, Protocol

from hil.errors import StoppedError

TimeKind = Literal["virtual", "real"]

_LEAST_SLEEP_S = 0.05  # no computer falls asleep and wakes in less
_LOOKS = 5  # at both clocks at once; the least disturbed counts


class Clock(Protocol):
    """Seconds since some instant, and waiting for a later one."""

    @property
    def now_s(self) -> float:
        """Seconds since the clock's own zero; never goes back."""
        ...

    @property
    def slept_s(self) -> float:
        """How long the computer has slept since this clock was made, while it stood still; 0 where nothing tells."""
        ...

    def sleep_until(self, deadline_s: float) -> None:
        """Return at `deadline_s` or later, at once when it has passed."""
        ...

    def stopped_before(self, deadline_s: float, stop: Event) -> bool:
        """Wait as `sleep_until` does, but no longer than until somebody stops it; returns whether somebody did."""
        ...


@dataclass(slots=True)
class VirtualClock:
    """A clock that stands still until it is told to wait: a run of an hour takes as long as its arithmetic.

    A test turns it by hand with `sleep_until`.
    """

    now_s: float = 0.0
    slept_s: float = 0.0

    def sleep_until(self, deadline_s: float) -> None:
        """Be at `deadline_s`, without waiting."""
        self.now_s = max(self.now_s, deadline_s)

    def stopped_before(self, deadline_s: float, stop: Event) -> bool:
        """Be at `deadline_s`, without waiting."""
        self.sleep_until(deadline_s)
        return stop.is_set()


class RealClock:
    """The host's monotonic clock. Waiting to absolute deadlines does not add up lateness."""

    def __init__(self) -> None:
        self._behind_s = min(_behind_s()[1] for _ in range(_LOOKS))

    @property
    def now_s(self) -> float:
        """Monotonic seconds."""
        return time.monotonic()

    @property
    def slept_s(self) -> float:
        """By how much the clock that goes on while the computer sleeps has left this one behind."""
        slept_s = _behind_s()[0] - self._behind_s
        return slept_s if slept_s > _LEAST_SLEEP_S else 0.0

    def sleep_until(self, deadline_s: float) -> None:
        """Sleep until the deadline."""
        while (left := deadline_s - time.monotonic()) > 0.0:
            time.sleep(left)

    def stopped_before(self, deadline_s: float, stop: Event) -> bool:
        """Wait for the deadline or the stop, whichever comes first."""
        return stop.wait(max(0.0, deadline_s - time.monotonic()))


def refuse_after_sleep(clock: Clock) -> None:
    """Nothing is driven on as if nothing had been when the computer has slept.

    Raises:
        StoppedError: it has since the clock was made.
    """
    if slept_s := clock.slept_s:
        raise StoppedError(
            f"the computer slept for {slept_s:.3g} s, and where outputs stood meanwhile is not known; the run was "
            "stopped"
        )


def _behind_s() -> tuple[float, float]:
    """Bounds of how far the monotonic clock is behind the one that goes on in sleep, however long each look takes."""
    boottime = getattr(time, "CLOCK_BOOTTIME", None)  # Linux; elsewhere nothing tells
    if boottime is None:
        return 0.0, 0.0
    before_s = time.clock_gettime(boottime)
    now_s = time.monotonic()
    return before_s - now_s, time.clock_gettime(boottime) - now_s


def clock(kind: TimeKind) -> Clock:
    """A clock of the asked kind."""
    return VirtualClock() if kind == "virtual" else RealClock()
