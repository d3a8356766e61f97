"""A connection to a device through which everything passes and is kept: what was really asked of it."""

from __future__ import annotations

import socket
import threading
from contextlib import suppress


class RecordedLine:
    """A TCP port in front of another one; `asked` has every piece that went to the device."""

    def __init__(self, device_port: int) -> None:
        self._device_port = device_port
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        self.asked: list[bytes] = []
        self._open: list[socket.socket] = [self._listener]
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        """End it."""
        for end in self._open:
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            with suppress(OSError):
                end.close()

    @property
    def modbus_functions(self) -> set[int]:
        """The functions that were asked for, as Modbus TCP has them; whole frames are sent at once."""
        found, data = set(), b"".join(self.asked)
        while data:
            length = int.from_bytes(data[4:6], "big")
            found.add(data[7])
            data = data[6 + length :]
        return found

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                far = socket.create_connection(("127.0.0.1", self._device_port))
                self._open += [near, far]
                threading.Thread(target=self._carry, args=(near, far, True), daemon=True).start()
                threading.Thread(target=self._carry, args=(far, near, False), daemon=True).start()

    def _carry(self, one: socket.socket, other: socket.socket, asking: bool) -> None:
        with suppress(OSError):
            while data := one.recv(4096):
                if asking:
                    self.asked.append(data)
                other.sendall(data)
        for end in (one, other):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
