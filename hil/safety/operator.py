"""What somebody at the bench asks of a run from outside: to stop at once, to hold, to go on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from hil.errors import StoppedError
from hil.safety.interrupt import Halted, halt_main_thread
from hil.safety.outputs import Outputs
from hil.system import system

Asked = Literal["stop", "hold", "resume"]

_LOOK_S = 0.05


class Operator:
    """The requests of an operator, as a run in this thread hears them; they may be made from any thread.

    A stop cuts a running block: the main thread is interrupted where it is. A run in another thread hears it at its
    next block. There is no way back from a stop. A hold is heard at the next border between parts, as that of an
    interlock is.

    Attributes:
        tell: takes what is known of the outputs after a stop, each time they were commanded safe and read back, and
            when the run is over.
        holding: told when the run begins and ends to hold.
        asked: told when a condition is to be set by hand; what it returns is asked until somebody has confirmed it.
        goes_on_by: what whoever confirms it does, in words; empty where it is taken as set.
        confirming: called again and again while outputs are commanded safe and read back.
        stopped_by: the account that asked for the stop first; empty where nobody is known.
    """

    def __init__(self) -> None:
        self.tell: Callable[[Outputs], None] = lambda _outputs: None
        self.holding: Callable[[bool], None] = lambda _holds: None
        self.confirming: Callable[[], None] = lambda: None
        self.asked: Callable[[], Callable[[], bool]] = lambda: _never
        self.goes_on_by = "go on"
        self._confirmed = _never
        self._in_main_thread = system.is_main_thread()
        self._stop, self._hold = system.event(), system.event()
        self._is_answered = False
        self.stopped_by = ""

    @property
    def stop_asked(self) -> bool:
        """Whether somebody pressed stop."""
        return self._stop.is_set()

    @property
    def hold_asked(self) -> bool:
        """Whether somebody wants the run to hold, or nobody has confirmed yet what was to be set by hand."""
        if self._hold.is_set() and self._confirmed():
            self.ask("resume")
        return self._hold.is_set()

    @property
    def waits(self) -> bool:
        """Whether a stop was asked for, and nothing was said of the outputs since."""
        return self.stop_asked and not self._is_answered

    def ask(self, what: Asked, by: str = "") -> None:
        """Say what the run shall do; `by`: the account that wants it, where one is known."""
        if what == "hold":
            self._hold.set()
        elif what == "resume":
            self._confirmed = _never
            self._hold.clear()
        else:
            if first := not self._stop.is_set():
                self.stopped_by = by
            self._stop.set()
            if first and self._in_main_thread:
                halt_main_thread()

    def ask_to_confirm(self) -> None:
        """Hold until somebody has confirmed what was to be set by hand: as `asked` says, or by a request to go on."""
        self._confirmed = self.asked()
        self._hold.set()

    def check(self) -> None:
        """Raise `Halted` when somebody pressed stop."""
        if self.stop_asked:
            raise Halted

    def answer(self, output_states: Outputs) -> bool:
        """Tell who asked for a stop what is known of the outputs now; whether that was the first time."""
        first = self.waits
        if self.stop_asked:
            self._is_answered = True
            self.tell(output_states)
        return first

    def confirms(self, output_states: Outputs) -> None:
        """The run makes its outputs safe; who asked for a stop is told when only time is missing to call them so."""
        self.confirming()
        if self.stop_asked and output_states.wait_s:
            self.tell(output_states)

    def wait(self, patience_s: float) -> None:
        """Stay here while a hold is asked for: on a bench whose time stands still meanwhile.

        Raises:
            Halted: somebody pressed stop.
            StoppedError: patience is over.
        """
        until_s = system.now_s() + patience_s
        while self.hold_asked:
            self.check()
            if system.now_s() > until_s:
                raise patience_over(patience_s)
            self._stop.wait(_LOOK_S)
        self.check()


def _never() -> bool:
    return False


def patience_over(patience_s: float) -> StoppedError:
    """The error of a run that was held for longer than its bench allows."""
    return StoppedError(f"the operator held the run for {patience_s:g} s, as long as patience_s allows; it was stopped")
