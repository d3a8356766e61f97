"""Real time, or virtual time that moves only when somebody waits."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Literal, Protocol

from hil.errors import StoppedError
from hil.system import system

TimeKind = Literal["virtual", "real"]

_LEAST_SLEEP_S = 0.05  # no computer falls asleep and wakes in less
_READINGS = 5  # at both clocks at once; the least disturbed counts


class Flag:
    """Set and cleared by one thread or several, waited for by one: an event that no signal can leave locked.

    A signal that raises within `threading.Event.set` may leave its lock taken for ever, and whoever waits for the event
    stands still. Each step here is one of the interpreter's own, which no signal divides.
    """

    def __init__(self) -> None:
        self._is_set = False
        self._rung: SimpleQueue[None] = system.queue()

    def is_set(self) -> bool:
        """Whether it is set."""
        return self._is_set

    def set(self) -> None:
        """Set it, and wake who waits."""
        self._is_set = True
        self._rung.put(None)

    def clear(self) -> None:
        """Take it back."""
        self._is_set = False
        while not self._rung.empty():
            with suppress(Empty):
                self._rung.get_nowait()

    def wait(self, timeout_s: float) -> bool:
        """Wait until it is set, but no longer than so long; whether it is."""
        if not self._is_set:
            with suppress(Empty):
                self._rung.get(timeout=timeout_s)
        return self._is_set


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

    def stopped_before(self, deadline_s: float, stop: Flag) -> bool:
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

    def stopped_before(self, deadline_s: float, stop: Flag) -> bool:
        """Be at `deadline_s`, without waiting."""
        self.sleep_until(deadline_s)
        return stop.is_set()


class RealClock:
    """The host's monotonic clock. Waiting to absolute deadlines does not add up lateness."""

    def __init__(self) -> None:
        self._behind_s = min(_behind_s()[1] for _ in range(_READINGS))

    @property
    def now_s(self) -> float:
        """Monotonic seconds."""
        return system.now_s()

    @property
    def slept_s(self) -> float:
        """By how much the clock that goes on while the computer sleeps has left this one behind."""
        slept_s = _behind_s()[0] - self._behind_s
        return slept_s if slept_s > _LEAST_SLEEP_S else 0.0

    def sleep_until(self, deadline_s: float) -> None:
        """Sleep until the deadline."""
        while (left := deadline_s - system.now_s()) > 0.0:
            system.sleep(left)

    def stopped_before(self, deadline_s: float, stop: Flag) -> bool:
        """Wait for the deadline or the stop, whichever comes first."""
        return stop.wait(max(0.0, deadline_s - system.now_s()))


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
    before_s = system.awake_or_asleep_s()
    now_s = system.now_s()
    after_s = system.awake_or_asleep_s()
    return (0.0, 0.0) if before_s is None or after_s is None else (before_s - now_s, after_s - now_s)


def clock(kind: TimeKind) -> Clock:
    """A clock of the asked kind."""
    return VirtualClock() if kind == "virtual" else RealClock()
