"""Signals by what they are for, as far as a system has them."""

from __future__ import annotations

import signal

INTERRUPT, TERMINATE, IGNORED = signal.SIGINT, signal.SIGTERM, signal.SIG_IGN
HALT = getattr(signal, "SIGUSR1", signal.SIGTERM)
"""Delivers a stop that was asked for from outside (see `hil.safety.operator`)."""
WAKE = getattr(signal, "SIGCONT", None)


def _those(*names: str) -> tuple[signal.Signals, ...]:
    return tuple(getattr(signal, name) for name in names if hasattr(signal, name))


ENDING = _those("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGBREAK", "SIGUSR1")
"""Ask a program to end."""
HOLDING_UP = (*ENDING, *_those("SIGUSR2", "SIGALRM", "SIGTSTP", "SIGTTIN", "SIGTTOU"))
"""All that can be ignored and would end or stop a program."""


def name_of(number: int) -> str:
    """As the system writes it: `SIGTERM`."""
    return signal.Signals(number).name
