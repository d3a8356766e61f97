"""Packets really lost, by the kernel and without root: a filter on a server's own sockets that lets nothing in.

What the other side sends meanwhile is neither received nor acknowledged; its kernel sends it again, as on a cable that
was pulled for a moment.
"""

from __future__ import annotations

import ctypes
import socket
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress

_ATTACH, _DETACH = 26, 27  # SO_ATTACH_FILTER, SO_DETACH_FILTER
_RETURN = 0x06  # of the packet, so many bytes: none


class _Instruction(ctypes.Structure):
    _fields_ = (("code", ctypes.c_uint16), ("jt", ctypes.c_uint8), ("jf", ctypes.c_uint8), ("k", ctypes.c_uint32))


class _Filter(ctypes.Structure):
    _fields_ = (("length", ctypes.c_uint16), ("instructions", ctypes.POINTER(_Instruction)))


def lose(sockets: Iterable[socket.socket]) -> None:
    """From now on nothing comes in on these sockets."""
    nothing = _Filter(1, ctypes.pointer(_Instruction(_RETURN, 0, 0, 0)))
    for one in sockets:
        with suppress(OSError):  # closed meanwhile
            one.setsockopt(socket.SOL_SOCKET, _ATTACH, bytes(nothing))


def heal(sockets: Iterable[socket.socket]) -> None:
    """From now on everything comes in again."""
    for one in sockets:
        with suppress(OSError):
            one.setsockopt(socket.SOL_SOCKET, _DETACH, 0)


@contextmanager
def lost(*sockets: socket.socket) -> Iterator[None]:
    """Nothing comes in on these sockets while inside."""
    lose(sockets)
    try:
        yield
    finally:
        heal(sockets)
