"""Any key of the terminal as a request to end, without waiting for the Enter key."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress


@contextmanager
def any_key() -> Iterator[Callable[[], bool]]:
    """A function that says whether a key was pressed; never true where nobody sits at a terminal.

    A terminal that is gone counts as a key. Ctrl-C stays the signal that it is.
    """
    if not _is_ours():
        yield lambda: False
        return
    import termios
    import tty

    place = sys.stdin.fileno()
    before = termios.tcgetattr(place)
    tty.setcbreak(place, termios.TCSANOW)
    try:
        yield lambda: _came(place)
    finally:
        with suppress(termios.error):
            termios.tcflush(place, termios.TCIFLUSH)
            termios.tcsetattr(place, termios.TCSANOW, before)


def _is_ours() -> bool:
    """Whether somebody types to this program: in the background, setting the terminal would stop it."""
    try:
        return sys.stdin.isatty() and os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except (AttributeError, OSError, ValueError):  # closed, no terminal of ours, or a system without
        return False


def _came(place: int) -> bool:
    try:
        return bool(select.select([place], [], [], 0.0)[0])
    except (OSError, ValueError):
        return True
