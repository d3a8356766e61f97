"""A TCP port on which a simulated device or bus takes clients."""

from __future__ import annotations

import socket
from collections.abc import Iterator

from hil.errors import FileError

_LOOK_S = 0.2  # how often it is seen whether it was closed


class Listener:
    """Listens on a port until it is closed.

    Attributes:
        host, port: where; with port 0 a free one is taken.
        socket: on which it listens.

    Raises:
        FileError: the port is taken by something else.
    """

    def __init__(self, host: str, port: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self.socket.bind((host, port))
        except OSError as error:
            self.socket.close()
            raise FileError(f"{host}:{port}: cannot listen there: {error.strerror}") from None
        self.socket.listen()
        self.socket.settimeout(_LOOK_S)
        self.host, self.port = self.socket.getsockname()

    def clients(self) -> Iterator[socket.socket]:
        """Each client that connects, what it sends not held back, until the port is closed."""
        while True:
            try:
                client, _ = self.socket.accept()
            except TimeoutError:
                continue
            except OSError:
                return
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            yield client

    def close(self) -> None:
        """Listen no longer. May be called twice."""
        self.socket.close()
