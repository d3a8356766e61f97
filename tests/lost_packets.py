"""Packets really lost, by the kernel and without root: a filter on a server's own sockets that lets nothing in.

What the other side sends meanwhile is neither received nor acknowledged; its kernel sends it again, as on a cable that
was pulled for a moment.
"""

from __future__ import annotations

import ctypes
import socket
import struct
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress

_ATTACH, _DETACH = 26, 27  # SO_ATTACH_FILTER, SO_DETACH_FILTER
_NOTHING = ctypes.create_string_buffer(struct.pack("HBBI", 0x06, 0, 0, 0))  # BPF_RET: no byte of a packet


def lose(sockets: Iterable[socket.socket]) -> None:
    """From now on nothing comes in on these sockets; a connection that is accepted later has what its listener has."""
    for one in sockets:
        with suppress(OSError):  # closed meanwhile
            one.setsockopt(socket.SOL_SOCKET, _ATTACH, struct.pack("HxxxxxxP", 1, ctypes.addressof(_NOTHING)))


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
