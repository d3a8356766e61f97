"""Signals: a request to end becomes an exception, and never interrupts the way to a safe state."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from hil.errors import HilError
from hil.system import Handler, system
from hil.system.signals import ENDING, HALT, IGNORED, INTERRUPT, TERMINATE, name_of

_AGAIN_S = 0.01


class Terminated(KeyboardInterrupt):
    """The program was asked to end by a signal other than Ctrl-C; handled like it.

    Attributes:
        number: of the signal.
    """

    def __init__(self, number: int = TERMINATE) -> None:
        super().__init__(name_of(number))
        self.number = number


class Halted(Terminated):
    """Somebody pressed stop: handled like a signal, but outputs jump to their safe values, also where one ramps."""

    def __init__(self) -> None:
        super().__init__(HALT)
        self.args = ("stop was pressed",)


def status_of(stopped: KeyboardInterrupt) -> int:
    """The exit status of a program that ended in order after a signal, as shells have it: 128 and its number."""
    return 128 + int(getattr(stopped, "number", INTERRUPT))


class _Requests:
    """The signals that came, and what becomes of them.

    Attributes:
        came: since they were taken over, in order.
        heard: how many `terminable` sections are open; held: how many `uninterrupted` ones.
        ending: one was raised and the way out has begun, or the way out was begun without: none is raised any more.
        cut: how many `cut_by_halt` sections are open: there a stop is raised whatever else is said here.
        told: called with what is about to be raised, before anybody can swallow it.
        giving_back: held while signals are let go of, and while one is sent from another thread.
    """

    def __init__(self) -> None:
        self.came: list[int] = []
        self.heard = self.held = self.cut = 0
        self.giving_back = system.lock()
        self.raised = self.ending = False
        self.listeners: list[Callable[[KeyboardInterrupt], None]] = []
        self._before: dict[int, Handler] = {}

    @property
    def can_raise(self) -> bool:
        """Whether a signal that comes now ends what is going on."""
        return bool(self.heard) and not self.held and not self.ending

    def install(self) -> bool:
        """Take the signals over, but for those that are ignored; whether that was left to do."""
        if self._before:
            return False
        self.came, self.raised, self.ending = [], False, False
        for number in ENDING:
            if (before := system.handler_of(number)) is not IGNORED:
                self._before[number] = before
                system.handle(number, self._on_signal)
        return True

    def take_back(self) -> None:
        """Take over again what somebody else has taken meanwhile: a library, or a procedure."""
        for number in self._before:
            if system.handler_of(number) != self._on_signal:
                system.handle(number, self._on_signal)

    def silence(self) -> None:
        """None has any effect any more, in this process: neither one that comes nor one that came."""
        self.came = []
        for number in ENDING:
            self._before[number] = IGNORED
            system.handle(number, IGNORED)

    def restore(self) -> None:
        """Let go of them."""
        with self.giving_back:
            before, self._before = self._before, {}
            for number, handler in before.items():
                system.handle(number, handler)

    def raise_what_came(self) -> None:
        """Raise the first that came, unless one was raised already."""
        if self.came and not self.raised:
            self._raise(self.came[0])

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        if number == HALT and HALT in self.came:
            return  # the same stop once more
        self.came.append(number)
        if self.cut and number == HALT:
            raise Halted
        if self.can_raise:
            self._raise(number)

    def _raise(self, number: int) -> None:
        self.raised = True
        error = _exception(number)
        for tell in tuple(self.listeners):
            tell(error)
        raise error

    def send_halt(self) -> bool:
        """Interrupt the main thread, also where it waits; whether anybody listens there and a signal can be sent.

        A signal that comes just before a wait begins does not end that wait: it is sent until it was heard.
        """
        came = self.came
        is_sent = self._send_halt(came)
        if is_sent:
            system.thread(self._halt_until_heard, came, name="hil-halt").start()
        return is_sent

    def _halt_until_heard(self, came: list[int]) -> None:
        while HALT not in came and self._send_halt(came):
            system.sleep(_AGAIN_S)

    def _send_halt(self, came: list[int]) -> bool:
        """To the section whose signals are `came`, not to a later one."""
        with self.giving_back:
            if came is not self.came:
                return False
            return HALT in self._before and system.interrupt_main_thread(HALT)


def _requests() -> _Requests:
    return system.of_process(_Requests)


@contextmanager
def terminable() -> Iterator[None]:
    """Signals that ask the program to end raise an exception inside: `Terminated`, or `KeyboardInterrupt` for Ctrl-C.

    Once the way out has begun (see `begin_ending`), further ones are remembered only: they change nothing any more. One
    that came so late that nothing was raised is raised at the end, unless an error is on its way. Main thread only.
    """
    if not system.is_main_thread():
        yield
        return
    outermost = _requests().install()
    _requests().heard += 1
    ending = _requests().ending
    try:
        yield
    except BaseException:
        _requests().ending = True  # until the outermost section is left: the error goes its way undisturbed
        raise
    else:
        _requests().ending = ending
    finally:
        _requests().heard -= 1
        if outermost:
            _requests().restore()
    _requests().raise_what_came()


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Signals that ask the program to end are remembered inside and take effect afterwards.

    In other threads, where Python delivers no signals, nothing needs to be done.
    """
    if not system.is_main_thread():
        yield
        return
    _requests().held += 1
    outermost = _requests().install()
    _requests().ending = _requests().ending or _requests().raised
    try:
        yield
    finally:
        _requests().held -= 1
        if outermost:
            _requests().restore()
            for number in dict.fromkeys(_requests().came):
                system.raise_signal(number)
    if _requests().can_raise:
        _requests().raise_what_came()


@contextmanager
def cut_by_halt() -> Iterator[None]:
    """A stop raises `Halted` inside, also on the way out and where signals are held: a ramp is no way out of that."""
    if not system.is_main_thread():
        yield
        return
    _requests().cut += 1
    try:
        yield
    finally:
        _requests().cut -= 1


def halt_main_thread() -> bool:
    """Send a stop to the main thread, as a signal that it hears; False where it does not hear any. From any thread."""
    return _requests().send_halt()


@contextmanager
def notified_of_signals(tell: Callable[[KeyboardInterrupt], None]) -> Iterator[None]:
    """Inside, `tell` is called with what a signal is about to raise, before anybody can swallow it."""
    _requests().listeners.append(tell)
    try:
        yield
    finally:
        _requests().listeners.remove(tell)


def raised() -> KeyboardInterrupt | None:
    """The first signal that was raised, where one was."""
    return _exception(_requests().came[0]) if _requests().raised and _requests().came else None


def ended_by(error: BaseException) -> BaseException:
    """The signal that was raised, where a library has made an error of its own of it; otherwise the error."""
    is_own = isinstance(error, HilError | KeyboardInterrupt) or not _requests().heard
    return error if is_own else raised() or error


def take_back_signals() -> None:
    """Hear the signals of `terminable` again, whoever has taken or ignored them inside."""
    if system.is_main_thread() and _requests().heard:
        _requests().take_back()


def begin_ending() -> None:
    """From here to the end of `terminable`, signals are remembered only."""
    if system.is_main_thread() and _requests().heard:
        _requests().ending = True


def ignore_signals() -> None:
    """The program has said how it ended, and nothing may change its exit status any more."""
    _requests().silence()


def _exception(number: int) -> KeyboardInterrupt:
    if number == INTERRUPT:
        return KeyboardInterrupt()
    return Halted() if number == HALT else Terminated(number)
