"""One operator, many viewers: the operator lock of the console, which one browser holds at a time."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from datetime import datetime

from hil.clock import Clock, RealClock
from hil.errors import InputError
from hil.language.note import Note

LAPSES_S = 30.0  # of a browser that is not heard of any more: its pages ask every half second


class OperatorLockedError(InputError):
    """Somebody else operates this console."""


@dataclass(frozen=True, slots=True)
class _Holder:
    session: str
    name: str
    since: datetime


class OperatorLock:
    """Who operates. Whoever acts first has it, until they let go, close their pages, or somebody takes it over.

    Args:
        clock: by which it lapses.
    """

    def __init__(self, clock: Clock | None = None) -> None:
        self._clock = clock or RealClock()
        self._lock = threading.Lock()
        self._holder: _Holder | None = None
        self._seen_s = 0.0

    @property
    def holder(self) -> str:
        """The name of who operates; empty when nobody does."""
        with self._lock:
            return self._present().name if self._present() else ""  # type: ignore[union-attr] # asked just before

    def refresh(self, session: str) -> None:
        """This browser has asked for something: it is there."""
        with self._lock:
            if self._present() and self._holder is not None and self._holder.session == session:
                self._seen_s = self._clock.now_s

    def take(self, session: str, name: str, over: bool = False) -> bool:
        """Operate from here on; whether that is new.

        Args:
            session: of the browser.
            name: of who sits there.
            over: take it from whoever has it.

        Raises:
            OperatorLockedError: somebody else has it.
        """
        with self._lock:
            holder = self._present()
            if holder is not None and holder.session == session:
                self._seen_s = self._clock.now_s
                return False
            if holder is not None and not over:
                raise OperatorLockedError(Note(
                    "{name} operates this console since {time}, in another browser; you may look, and you may stop; "
                    "take over to operate",
                    name=holder.name, time=f"{holder.since.astimezone():%H:%M}",
                ))  # fmt: skip
            self._holder = _Holder(session, name, datetime.now().astimezone())
            self._seen_s = self._clock.now_s
            return True

    def leave(self, session: str) -> None:
        """Let go of it."""
        with self._lock:
            if self._holder is not None and self._holder.session == session:
                self._holder = None

    def _present(self) -> _Holder | None:
        if self._clock.now_s - self._seen_s > LAPSES_S:
            self._holder = None
        return self._holder
