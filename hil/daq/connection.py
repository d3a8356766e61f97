"""The one place where connections are made and given up: after that this computer sends nothing more on them.

A socket that is closed goes on sending what was not acknowledged, for minutes and behind the back of the program: an
old command would arrive after the safe value that went out on a new connection. So every connection ends at its kernel
when its process dies (`SO_LINGER` {1, 0}), when nothing is acknowledged for the link's time-out (`TCP_USER_TIMEOUT`),
and when it is given up (`close`); and no child process that is forked holds one.
"""

from __future__ import annotations

import ctypes
import os
import select
import socket
import struct
import time
import weakref
from contextlib import suppress
from typing import Any

_ABORTING, _IN_ORDER = struct.pack("ii", 1, 0), struct.pack("ii", 0, 0)
_NOBODY = struct.pack("HHQ", socket.AF_UNSPEC, 0, 0)
_UNSENT = 0x5411  # SIOCOUTQ: bytes that the other side has not acknowledged
_LOOK_S = 0.002
_not_for_children: weakref.WeakSet[Any] = weakref.WeakSet()


def connect(host: str, port: int, timeout_s: float) -> socket.socket:
    """A TCP connection that ends when it is given up.

    Args:
        host: name or number of the other side.
        port: there.
        timeout_s: of the link: connecting may take so long, and so long what is sent may stay without acknowledgement.

    Raises:
        OSError: nobody is there.
    """
    error: OSError = ConnectionRefusedError(f"{host}: no address")
    for family, kind, protocol, _, place in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM):
        made = socket.socket(family, kind, protocol)
        try:
            guard(made, timeout_s)
            made.settimeout(timeout_s)
            made.connect(place)
        except OSError as failed:
            made.close()
            error = failed
        else:
            return made
    raise error


def is_hung_up(held: socket.socket | None) -> bool:
    """Whether the other side has closed a connection on which nothing is awaited, as some do that idle for a while."""
    if held is None:
        return True
    try:
        ready, _, _ = select.select([held], [], [], 0.0)
        return bool(ready) and not held.recv(1, socket.MSG_PEEK)
    except OSError:
        return True


def guard(made: socket.socket, timeout_s: float) -> socket.socket:
    """The same for a socket that a library made by itself."""
    with suppress(OSError):  # no TCP
        made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _ABORTING)
        if hasattr(socket, "TCP_USER_TIMEOUT"):
            made.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, max(1, round(1000.0 * timeout_s)))
    close_in_children(made)
    return made


def close(made: socket.socket, patience_s: float = 0.0) -> None:
    """Close a connection. What the other side has not acknowledged is not sent again, whoever else holds the socket.

    Args:
        made: the connection.
        patience_s: so long what was sent may take to be acknowledged, where nothing was lost on it.
    """
    until_s = time.monotonic() + patience_s
    while (left := _unacknowledged(made)) and time.monotonic() < until_s:
        time.sleep(_LOOK_S)
    with suppress(Exception):
        if left:
            ctypes.CDLL(None).connect(made.fileno(), _NOBODY, len(_NOBODY))  # the kernel forgets all that it holds
        else:
            made.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _IN_ORDER)
            made.shutdown(socket.SHUT_RDWR)
    with suppress(OSError):
        made.close()


def close_in_children(held: Any) -> None:
    """A socket, port or pipe that no forked child shall hold: what is closed here would live on there."""
    _not_for_children.add(held)


def _unacknowledged(made: socket.socket) -> int:
    try:
        import fcntl

        return int(struct.unpack("i", fcntl.ioctl(made.fileno(), _UNSENT, b"\0" * 4))[0])
    except (ImportError, OSError, ValueError):  # not told here, or closed
        return 0


def _in_child() -> None:
    for held in list(_not_for_children):
        with suppress(Exception):
            held.close()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_in_child)
