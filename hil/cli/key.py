"""Any key of the terminal as a request to end, without waiting for the Enter key."""

from __future__ import annotations

import select
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress


@contextmanager
def any_key() -> Iterator[Callable[[], bool]]:
    """A function that says whether a key was pressed; never true where nobody sits at a terminal.

    A terminal that is gone counts as a key. Ctrl-C stays the signal that it is.
    """
    from hil.session.terminal import is_ours

    if not is_ours():
        yield lambda: False
        return
    import termios
    import tty

    place = sys.stdin.fileno()
    before = termios.tcgetattr(place)
    tty.setcbreak(place, termios.TCSANOW)
    try:
        yield lambda: _key_came(place)
    finally:
        with suppress(termios.error):
            termios.tcflush(place, termios.TCIFLUSH)
            termios.tcsetattr(place, termios.TCSANOW, before)


def _key_came(place: int) -> bool:
    try:
        return bool(select.select([place], [], [], 0.0)[0])
    except (OSError, ValueError):
        return True
