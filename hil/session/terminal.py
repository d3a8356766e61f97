"""Whoever sits at the terminal confirms with the Enter key what was to be set by hand."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Callable
from contextlib import suppress

from hil.safety.operator import Operator


def operator_here(is_simulated: bool) -> Operator:
    """The operator of a run of this program: at a terminal the Enter key confirms, as *Go on* in the console does.

    Nobody is asked on a simulated bench where nobody sits at a terminal.
    """
    operator = Operator()
    if is_ours():
        operator.asked, operator.goes_on_by = _enter_key(), "press Enter"
    elif is_simulated:
        operator.goes_on_by = ""
    return operator


def is_ours() -> bool:
    """Whether somebody types to this program: in the background, setting the terminal would stop it."""
    try:
        return sys.stdin.isatty() and os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except (AttributeError, OSError, ValueError):  # closed, no terminal of ours, or a system without
        return False


def _enter_key() -> Callable[[], Callable[[], bool]]:
    """What tells from when it is called whether a line was entered; what was typed before confirms nothing."""
    import termios

    place = sys.stdin.fileno()

    def entered() -> bool:
        with suppress(OSError, ValueError):  # a terminal that is gone confirms nothing
            return bool(select.select([place], [], [], 0.0)[0]) and b"\n" in os.read(place, 4096)
        return False

    def asked() -> Callable[[], bool]:
        with suppress(termios.error):
            termios.tcflush(place, termios.TCIFLUSH)
        return entered

    return asked
