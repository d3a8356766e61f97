"""A serial line between a program and a device: held by its handshake for a while, it gives out later what was sent."""

from __future__ import annotations

import os
import select
import threading
import tty
from collections.abc import Callable
from contextlib import suppress

from tests.foreign_line import WholeRequest

_LOOK_S = 0.02


class SerialLine:
    """Gives whatever `answer` makes of a request; at `address` the program opens its end.

    Args:
        answer: of the device.
        whole: how many of the bytes that have come are the first request.
    """

    def __init__(self, answer: Callable[[bytes], bytes], whole: WholeRequest) -> None:
        self._answer, self._whole = answer, whole
        self._near, self._far = os.openpty()  # the far end stays open, so that the program may close and open it
        tty.setraw(self._far)
        self.address = os.ttyname(self._far)
        self._held, self._over = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._talk, daemon=True)
        self._thread.start()

    def lose(self) -> None:
        """From now on nothing passes: the line keeps what it is given."""
        self._held.set()

    def heal(self) -> None:
        """It passes, and so does all that was kept."""
        self._held.clear()

    def reset(self) -> None:
        """What is on its way is lost."""
        with suppress(OSError):
            tty.tcflush(self._near, tty.TCIOFLUSH)

    def close(self) -> None:
        """End it."""
        self._over.set()
        self._thread.join()
        os.close(self._near)
        os.close(self._far)

    def _talk(self) -> None:
        waiting = b""
        while not self._over.is_set():
            if self._held.is_set():
                self._over.wait(_LOOK_S)
                continue
            if not select.select([self._near], [], [], _LOOK_S)[0]:
                continue
            waiting += os.read(self._near, 4096)
            while count := self._whole(waiting):
                request, waiting = waiting[:count], waiting[count:]
                os.write(self._near, self._answer(request))
