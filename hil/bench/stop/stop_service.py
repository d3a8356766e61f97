"""Where a stop is asked for, and where whoever made the outputs safe says what came of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, Literal

from hil.safety.operator import Asked
from hil.safety.outputs import Output, State, record_of
from hil.system import system

By = Literal["run", "watchdog"]


@dataclass(frozen=True, slots=True)
class OutputStatus:
    """What is known of the outputs after a stop.

    Attributes:
        outputs: each, by channel, in the units of the bench.
        by: who asked the devices.
        at_s: when, on the monotonic clock.
    """

    outputs: Mapping[str, Output]
    by: By
    at_s: float

    @property
    def is_confirmed(self) -> bool:
        """Whether each output was read back at its safe value; nothing less is called so."""
        return bool(self.outputs) and all(output.state is State.SAFE for output in self.outputs.values())

    @property
    def is_final(self) -> bool:
        """Whether more will not be known: an output that nobody can ask is never confirmed, nor one that is denied."""
        return bool(self.outputs) and all(output.is_commanded for output in self.outputs.values())

    def answer(self, since_s: float) -> dict[str, Any]:
        """As it is sent to who asked at an instant."""
        return {
            "state": "confirmed" if self.is_confirmed else "unconfirmed",
            "seconds": round(max(0.0, self.at_s - since_s), 4),
            "outputs": record_of(self.outputs),
            "by": self.by,
        }


class StopService:
    """Takes requests and hands them on; keeps who waits until the outputs are known to be safe.

    Args:
        units: of each output, by channel; nothing is known of them yet.
        by: at whom requests arrive.
        act: hands a request on; returns at once.

    Attributes:
        status: what was said last.
        stopped_by: the account that asked for the first stop; empty where nobody is known.
    """

    def __init__(self, units: Mapping[str, str], by: By, act: Callable[[Asked], None]) -> None:
        self._act = act
        self._lock = system.lock()
        self._waiting: list[Future[OutputStatus]] = []
        self._nothing = {name: Output(State.UNKNOWN, unit) for name, unit in units.items()}
        self.status = OutputStatus(self._nothing, by, system.now_s())
        self._holding = self._hold_asked = self._stop_asked = False
        self.stopped_by = ""

    @property
    def hold(self) -> str:
        """How the run stands to a hold: `running`, `asked` or `holding`."""
        if not self._hold_asked:
            return "running"
        return "holding" if self._holding else "asked"

    def stop(self, by: str = "") -> Future[OutputStatus]:
        """Ask for a stop, for an account; done when more will not be known of the outputs than is then told."""
        future: Future[OutputStatus] = Future()
        with self._lock:
            if self.status.is_final:
                future.set_result(self.status)
                return future
            if not self._stop_asked:
                self.stopped_by, self._stop_asked = by, True
            self._waiting.append(future)
        self._act("stop")
        return future

    def ask_to_hold(self, hold: bool) -> str:
        """Ask the run to hold, or to go on."""
        self._hold_asked = hold
        self._act("hold" if hold else "resume")
        return self.hold

    def holds(self, holding: bool) -> None:
        """The run has begun to hold, or goes on."""
        self._holding = holding

    def tell(self, outputs: Mapping[str, Output], by: By) -> None:
        """Say what is known of the outputs since a stop was asked for, or since the run is dead."""
        with self._lock:
            self.status = OutputStatus({**self.status.outputs, **outputs}, by, system.now_s())
            done, self._waiting = (self._waiting, []) if self.status.is_final else ([], self._waiting)
        self._answer(done)

    def forget(self) -> None:
        """What the run said does not count any more: it is dead, and what it sent may still be on its way."""
        with self._lock:
            self.status = OutputStatus(self._nothing, "watchdog", system.now_s())

    def close(self) -> None:
        """Nobody will tell more: who still waits is answered with what is known."""
        with self._lock:
            waiting, self._waiting = self._waiting, []
        self._answer(waiting)

    def give_up(self, waiting: Future[OutputStatus]) -> None:
        """Nobody waits for this one any more."""
        with self._lock:
            self._waiting = [future for future in self._waiting if future is not waiting]

    def _answer(self, waiting: list[Future[OutputStatus]]) -> None:
        for future in waiting:
            if future.set_running_or_notify_cancel():
                future.set_result(self.status)
