"""How a run ends: once, by whatever ends it first, and without waiting for its procedure.

What is said of the outputs, what is written down, and that nothing on the way can skip it.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from typing import Any, NoReturn, TypeVar

from hil.errors import StoppedError, StorageError, with_notes
from hil.record.folder import RunWriter
from hil.safety.guard import Guard, is_end
from hil.safety.interrupt import begin_ending, take_back_signals, uninterrupted
from hil.safety.outputs import Outputs
from hil.system import system

LEAVES_S = 5.0  # so long a procedure has to return once the last word was said
_T = TypeVar("_T")


class LastWord:
    """What the process of a command says when its run has ended, once, and with which status it then leaves.

    The word is said as soon as the outputs are safe and the record is closed. A procedure that has not returned
    `LEAVES_S` later, or that swallows the end twice, keeps the process no longer: it leaves by `os._exit`, which runs
    no code of the procedure.

    Args:
        say: says how the run ended; returns the exit status.
    """

    def __init__(self, say: Callable[[BaseException], int]) -> None:
        self._say = say
        self._status: int | None = None
        self._leaving: Any = None

    def say(self, error: BaseException) -> int:
        """Say it, unless it was said; returns the exit status."""
        if self._status is None:
            self._status = self._say(error)
        return self._status

    @property
    def status(self) -> int:
        """With which the process leaves: as was said, else as a run that was broken off."""
        return StoppedError.exit_status if self._status is None else self._status

    def leave_soon(self) -> None:
        """Leave if the procedure does not return."""
        self._leaving = system.later(LEAVES_S, self.leave)
        self._leaving.start()

    def stay(self) -> None:
        """The procedure has returned."""
        if self._leaving is not None:
            self._leaving.cancel()

    def leave(self) -> None:
        """Leave now, with the status that was said."""
        if self._status is not None:
            system.leave(self._status)


_of_this_process: list[LastWord] = []


@contextmanager
def last_word(say: Callable[[BaseException], int]) -> Iterator[LastWord]:
    """Inside, this process is that of a command: a run that ends says its last word, and may end the process.

    Elsewhere, as in a notebook or in pytest, every call to the bench raises what ended its run, and that is all.
    """
    word, pid, leave = LastWord(say), system.pid(), os._exit

    def leave_with_our_status(status: int) -> NoReturn:  # a procedure that calls it has not come to its end
        leave(word.status if system.pid() == pid else status)

    _of_this_process.append(word)
    os._exit = leave_with_our_status
    try:
        yield word
    finally:
        os._exit = leave
        if system.pid() != pid:  # a child that a procedure has forked is not the command
            os._exit(StoppedError.exit_status)
        _of_this_process.remove(word)


def word_of_this_process() -> LastWord | None:
    """The last word of the command that this process is; None where it is somebody else's."""
    return _of_this_process[-1] if _of_this_process else None


class Ending:
    """The end of a run: what is undone, last first, as soon as something ends it, and what ended it.

    It is not known who calls what afterwards, nor from which thread: a procedure may swallow what it is told. So every
    call to the bench is a `task`, or begins with `check`, and what ends the run is raised by all that come later.

    Args:
        word: said when an error has ended the run.

    Attributes:
        error: what ended the run.
        guard: made final, too.
    """

    def __init__(self, word: LastWord | None = None) -> None:
        self.error: BaseException | None = None
        self.guard: Guard | None = None
        self._word = word
        self._undo = ExitStack()
        self._lock = system.rlock()
        self._at_work = self._raised_again = 0
        self._streams: list[Generator[object]] = []
        self._is_over = False
        self._pid = system.pid()
        system.at_exit(self._left_open)  # who never leaves the bench leaves it when the program ends

    def enter(self, context: AbstractContextManager[_T]) -> _T:
        """Enter what is left when the run ends."""
        return self._undo.enter_context(context)

    def check(self) -> None:
        """Raise what has ended the run; who swallows it twice leaves, where the process is that of a command.

        Raises:
            StoppedError: this process was forked from the one that drives the bench.
        """
        if system.pid() != self._pid:
            raise StoppedError("this process was forked from a run; only the run itself drives its bench")
        if self.error is None:
            return
        self._raised_again += 1
        if self._raised_again > 1 and self._word is not None:
            self._word.leave()
        raise self.error

    @contextmanager
    def task(self) -> Iterator[None]:
        """The bench is at work inside; an error that ends the run ends it before the procedure hears of it."""
        self.check()
        take_back_signals()
        with self._working():
            yield

    @contextmanager
    def _working(self) -> Iterator[None]:
        with self._lock:
            failed, outer = None, self._at_work
            try:
                self._at_work = outer + 1
                yield
            except BaseException as error:
                failed = error if is_end(error) else None
                raise
            finally:
                self._at_work = outer
                if not outer and (failed := failed or self._over):
                    self.end(failed)

    def streamed(self, pieces: Generator[_T]) -> Generator[_T]:
        """A stream of which each piece is a task; between two of them the run may be ended."""
        self._streams.append(pieces)
        try:
            while True:
                with self.task():
                    piece = next(pieces, None)
                if piece is None:
                    return
                yield piece
        finally:
            with self._working():
                self._streams.remove(pieces)
                pieces.close()

    def signalled(self, error: KeyboardInterrupt) -> None:
        """A signal came: it ends the run here and now, or, where the bench is at work, at its next block."""
        if system.pid() != self._pid:
            return
        if self.guard is not None:
            self.guard.end(error)
        if self._lock.acquire(blocking=False):
            try:
                if not self._at_work:
                    self.end(error)
            finally:
                self._lock.release()

    def end(self, error: BaseException | None) -> None:
        """Undo everything, say the last word; a second call does nothing. What came of it stands in `error`.

        Args:
            error: what ended the run; None when its procedure was through.
        """
        if system.pid() != self._pid:
            self.error = error
            return
        with self._lock:
            if self._is_over:
                return
            self._is_over = True
            system.not_at_exit(self._left_open)
            error = self._over or error
            if self.guard is not None and error is not None:
                self.guard.end(error)
            with uninterrupted():
                self.error = self._undo_all(error)
                if self.error is not None and self._word is not None:
                    self._word.say(self.error)
                    self._word.leave_soon()

    def returned(self) -> None:
        """The procedure has returned, in whatever way: raise what ended the run."""
        if self._word is not None:
            self._word.stay()
        if self.error is not None and not sys.is_finalizing():  # nobody is left who could hear it
            raise self.error

    def _left_open(self) -> None:
        self.end(StoppedError("the program ended, and its bench was still open"))

    @property
    def _over(self) -> BaseException | None:
        return None if self.guard is None else self.guard.over

    def _undo_all(self, error: BaseException | None) -> BaseException | None:
        begin_ending()
        for pieces in self._streams:
            with suppress(BaseException):
                pieces.close()
        try:
            if error is None:
                self._undo.close()
            else:
                self._undo.__exit__(type(error), error, error.__traceback__)
        except BaseException as last:
            return last
        return error


@contextmanager
def accounted(output_states: Outputs) -> Iterator[None]:
    """Whatever ends what is inside leaves it with the exit status and the sentence that follow from the outputs.

    Raises:
        NotSafeError: nothing went wrong, but an output is not settled.
    """
    try:
        yield
        output_states.check()
    except BaseException as error:
        begin_ending()
        output_states.mark(error)
        raise


@contextmanager
def closed_for_sure(close: Callable[[], None]) -> Iterator[None]:
    """Calls `close` afterwards; once more if a signal came just as it began. The error that was first stays the one.

    What goes wrong in `close` after an error is noted on that error.
    """
    try:
        yield
    except BaseException as error:
        begin_ending()
        _noting(error, close)
        raise
    try:
        begin_ending()
        close()
    except BaseException as error:
        _noting(error, close)
        raise


@contextmanager
def recorded(writer: RunWriter, output_states: Outputs, stopped_by: Callable[[], str] = str) -> Iterator[RunWriter]:
    """A run folder that is sealed afterwards: with how the run ended, and what was known of each output then.

    Args:
        writer: of the folder.
        output_states: what is known of the outputs.
        stopped_by: the account that stopped the run; empty where nobody is known to have.

    Raises:
        StorageError: it does not lie any more where it was begun; says where it is.
    """
    outcome, begun = "completed", writer.path

    def seal() -> None:
        by: dict[str, Any] = {"stopped_by": account} if (account := stopped_by()) else {}
        writer.close(outcome, outputs=output_states.record(), **by)
        if writer.path != begun:
            raise StorageError(f"what was recorded is kept in {writer.path}")

    with closed_for_sure(seal):
        try:
            yield writer
            output_states.check()
        except BaseException as error:
            output_states.mark(error)
            outcome = f"{type(error).__name__}: {with_notes(error)}"
            raise


def _noting(error: BaseException, close: Callable[[], None]) -> None:
    try:
        close()
    except BaseException as second:
        text = with_notes(second)
        if text and second is not error and text != str(error):
            error.add_note(text)
