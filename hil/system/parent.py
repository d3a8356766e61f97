"""The program that started this process, heard through a pipe, beside what is asked of this process from elsewhere."""

from __future__ import annotations

import os
import queue
import select
import signal
import socket
import threading
from contextlib import suppress
from typing import Generic, TypeVar

_Asked = TypeVar("_Asked")


class Parent(Generic[_Asked]):
    """What the program says, and what is asked from another thread, one after the other, waited for with a limit.

    The pipe may be held open by children of the program, so the process itself is watched too, where the system can.

    Args:
        pid: of the program; None: its pipe alone tells that it has ended.
        hears: descriptor of the pipe on which the program speaks.
        speaks: descriptor of the pipe on which it listens.
    """

    def __init__(self, pid: int | None = None, hears: int = 0, speaks: int = 1) -> None:
        self._descriptor = hears if os.name == "posix" else _as_socket(hears)
        self._speaks = speaks
        self._requests: queue.SimpleQueue[_Asked] = queue.SimpleQueue()
        self._called, self._call = socket.socketpair()
        self._call.setblocking(False)
        self._program = None if pid is None else _process(pid)

    def request(self, what: _Asked) -> None:
        """Somebody asks for something. From any thread."""
        self._requests.put(what)
        with suppress(OSError):  # full: it will wake up
            self._call.send(b"!")

    def next(self, timeout_s: float | None) -> bytes | _Asked | None:
        """What came; nothing at the end of the pipe or of the program, None when nothing came in time."""
        called = self._called.fileno()
        places = [self._descriptor, called, *([] if self._program is None else [self._program])]
        ready, _, _ = select.select(places, [], [], timeout_s)
        if self._descriptor in ready:
            return os.read(self._descriptor, 4096)
        if called in ready:
            self._called.recv(1)
            return self._requests.get()
        return b"" if ready else None

    def say(self, what: bytes) -> None:
        """Answer the program, unless nobody listens any more."""
        with suppress(OSError):
            os.write(self._speaks, what)

    def close(self) -> None:
        """Listen no more."""
        self._called.close()
        self._call.close()
        if self._program is not None:
            os.close(self._program)

    def kill(self, pid: int) -> None:
        """End the program, so that it cannot wake up and drive on; never another that has got its number since."""
        with suppress(ProcessLookupError):
            if self._program is not None:
                signal.pidfd_send_signal(self._program, signal.SIGKILL)
            else:
                os.kill(pid, getattr(signal, "SIGKILL", signal.SIGTERM))  # noqa: TID251


def _process(pid: int) -> int | None:
    """A descriptor that can be read once the process has ended; None where the system has none."""
    try:
        return os.pidfd_open(pid)
    except (AttributeError, OSError):
        return None


def _as_socket(descriptor: int) -> int:
    """The same bytes from a socket, on a system that cannot wait for a pipe and a socket together."""
    near, far = socket.socketpair()

    def copy() -> None:
        with far:
            while data := os.read(descriptor, 4096):
                far.sendall(data)

    threading.Thread(target=copy, daemon=True).start()
    return near.detach()
