"""Signals: a request to end becomes an exception, and never interrupts the way to a safe state."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_SIGNALS = [signal.SIGINT, signal.SIGTERM]


class Terminated(KeyboardInterrupt):
    """The program was asked to end (SIGTERM); handled like Ctrl-C."""


@contextmanager
def terminable() -> Iterator[None]:
    """SIGTERM raises `Terminated` inside, as Ctrl-C raises `KeyboardInterrupt`. Main thread only."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, _raise_terminated)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Ctrl-C and SIGTERM that come inside are remembered and take effect afterwards.

    In other threads, where Python delivers no signals, nothing needs to be done.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    before = {number: signal.signal(number, lambda caught, _frame: came.append(caught)) for number in _SIGNALS}
    try:
        yield
    finally:
        for caught, handler in before.items():
            signal.signal(caught, handler)
        for number in dict.fromkeys(came):
            signal.raise_signal(number)


def _raise_terminated(_number: int, _frame: FrameType | None) -> None:
    raise Terminated
