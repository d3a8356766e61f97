"""Real time, or virtual time that moves only when somebody waits."""

from __future__ import annotations

import time
from dataclasses import dataclass
from threading import Event
from typing import Literal, Protocol

TimeKind = Literal["virtual", "real"]


class Clock(Protocol):
    """Seconds since some instant, and waiting for a later one."""

    @property
    def now_s(self) -> float:
        """Seconds since the clock's own zero; never goes back."""
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

    def sleep_until(self, deadline_s: float) -> None:
        """Be at `deadline_s`, without waiting."""
        self.now_s = max(self.now_s, deadline_s)

    def stopped_before(self, deadline_s: float, stop: Event) -> bool:
        """Be at `deadline_s`, without waiting."""
        self.sleep_until(deadline_s)
        return stop.is_set()


class RealClock:
    """The host's monotonic clock. Waiting to absolute deadlines does not add up lateness."""

    @property
    def now_s(self) -> float:
        """Monotonic seconds."""
        return time.monotonic()

    def sleep_until(self, deadline_s: float) -> None:
        """Sleep until the deadline."""
        while (left := deadline_s - time.monotonic()) > 0.0:
            time.sleep(left)

    def stopped_before(self, deadline_s: float, stop: Event) -> bool:
        """Wait for the deadline or the stop, whichever comes first."""
        return stop.wait(max(0.0, deadline_s - time.monotonic()))


def clock(kind: TimeKind) -> Clock:
    """A clock of the asked kind."""
    return VirtualClock() if kind == "virtual" else RealClock()
