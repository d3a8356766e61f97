"""The one place where connections are made and given up: after that this computer sends nothing more on them.

A socket that is closed goes on sending what was not acknowledged, for minutes and behind the back of the program: an
old command would arrive after the safe value that went out on a new connection. So every connection ends at its kernel
when its process dies (`SO_LINGER` {1, 0}), when nothing is acknowledged for the link's time-out (`TCP_USER_TIMEOUT`),
and when it is given up (`close`); and no child process that is forked holds one.
"""

from __future__ import annotations

import os
import socket
import struct
import weakref
from contextlib import suppress
from typing import Any

from hil.system import system

_ABORTING, _IN_ORDER = struct.pack("ii", 1, 0), struct.pack("ii", 0, 0)
_LOOK_S = 0.002
_MOST = 4096
not_for_children: weakref.WeakSet[Any] = weakref.WeakSet()
"""What is closed in a child process that somebody forks (see `close_in_children`)."""


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
    for family, kind, protocol, place in system.addresses(host, port):
        made = system.new_socket(family, kind, protocol)
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


class TcpConnection:
    """A TCP connection, made as by `connect`: what is read are bytes that have come, if any did.

    Raises:
        OSError: nobody is there; of every method but the last three, the connection is gone.
    """

    def __init__(self, host: str, port: int, timeout_s: float) -> None:
        self._held, self._timeout_s = connect(host, port, timeout_s), timeout_s

    def write(self, data: bytes) -> None:
        """Send all of it."""
        self._held.sendall(data)

    def read(self, wait_s: float) -> bytes:
        """What has come, waited for so long."""
        ready = system.is_readable(self._held, max(0.0, wait_s))
        came = self._held.recv(_MOST) if ready else b""
        if ready and not came:
            raise ConnectionResetError("the other side has closed it")
        return came

    @property
    def is_hung_up(self) -> bool:
        """See `is_hung_up`."""
        return is_hung_up(self._held)

    def drop(self) -> None:
        """Give it up: nothing more is sent on it."""
        close(self._held)

    def let_go(self) -> None:
        """Close it in order: whatever was sent was answered."""
        close(self._held, self._timeout_s)


def is_hung_up(made: socket.socket) -> bool:
    """Whether the other side has closed it while nothing was awaited, as some do when it idles for a while."""
    try:
        return system.is_readable(made, 0.0) and not made.recv(1, socket.MSG_PEEK)
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


def kept_by(client: object) -> list[socket.socket]:
    """The sockets that a library's client made by itself."""
    return [held for held in vars(client).values() if isinstance(held, socket.socket)]


def close(made: socket.socket, patience_s: float = 0.0) -> None:
    """Close a connection. What the other side has not acknowledged is not sent again, whoever else holds the socket.

    Args:
        made: the connection.
        patience_s: so long what was sent may take to be acknowledged, where nothing was lost on it.
    """
    until_s = system.now_s() + patience_s
    while (left := system.unacknowledged(made)) and system.now_s() < until_s:
        system.sleep(_LOOK_S)
    with suppress(Exception):
        if left:
            system.forget(made)
        else:
            made.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _IN_ORDER)
            made.shutdown(socket.SHUT_RDWR)
    with suppress(OSError):
        made.close()


def close_in_children(held: Any) -> None:
    """A socket, port or pipe that no forked child shall hold: what is closed here would live on there."""
    not_for_children.add(held)


def _in_child() -> None:
    for held in list(not_for_children):
        with suppress(Exception):
            held.close()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_in_child)
