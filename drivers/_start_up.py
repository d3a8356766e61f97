"""Devices that answer only after a start-up of their own."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from hil.errors import DeviceLostError, LinkError
from hil.system import system

_T = TypeVar("_T")
_AGAIN_S = 0.25  # how often a device is asked that is starting up


def once_started(startup_s: float, ask: Callable[[], _T]) -> _T:
    """What a device answers, asked again for as long as it may take to start.

    Args:
        startup_s: how long it may take; 0: it is asked once.
        ask: opens the link as far as it is closed, and asks; leaves nothing open when it raises.

    Raises:
        LinkError, DeviceLostError: it did not answer in its time.
    """
    begun_s = system.now_s()
    while True:
        try:
            return ask()
        except (LinkError, DeviceLostError) as error:
            waited_s = system.now_s() - begun_s
            if waited_s >= startup_s:
                after = f"after {waited_s:.3g} s of its start-up: " if startup_s else ""
                raise type(error)(f"{after}{error}") from error
            system.sleep(min(_AGAIN_S, startup_s))
