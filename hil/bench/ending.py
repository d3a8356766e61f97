"""How a run ends: what is said of its outputs, what is written down, and that nothing on the way can skip it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from hil.errors import StorageError, told
from hil.record.folder import RunWriter
from hil.safety.interrupt import begin_ending
from hil.safety.outputs import Outputs


@contextmanager
def accounted(known: Outputs) -> Iterator[None]:
    """Whatever ends what is inside leaves it with the exit status and the sentence that follow from the outputs.

    Raises:
        NotSafeError: nothing went wrong, but an output is not settled.
    """
    try:
        yield
        known.check()
    except BaseException as error:
        begin_ending()
        known.mark(error)
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
def recorded(writer: RunWriter, known: Outputs) -> Iterator[RunWriter]:
    """A run folder that is sealed afterwards: with how the run ended, and what was known of each output then.

    Raises:
        StorageError: it does not lie any more where it was begun; says where it is.
    """
    outcome, begun = "completed", writer.path

    def seal() -> None:
        writer.close(outcome, outputs=known.record())
        if writer.path != begun:
            raise StorageError(f"what was recorded is kept in {writer.path}")

    with closed_for_sure(seal):
        try:
            yield writer
            known.check()
        except BaseException as error:
            known.mark(error)
            outcome = f"{type(error).__name__}: {told(error)}"
            raise


def _noting(error: BaseException, close: Callable[[], None]) -> None:
    try:
        close()
    except BaseException as second:
        text = told(second)
        if text and second is not error and text != str(error):
            error.add_note(text)
