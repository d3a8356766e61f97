"""Bytes to a device and back: on TCP, or on a serial port that all devices of its line share."""

from __future__ import annotations

import errno
import re
import select
import threading
from typing import Any

from drivers._edge import guard_port
from drivers._shared_port import SharedPort, shared_port
from hil.daq.address import Port
from hil.daq.connection import close, connect, is_hung_up
from hil.errors import DeviceLostError

_LOOK_S = 0.02  # how often the clock is looked at while an answer is waited for
_MOST = 4096


class TcpPort:
    """A TCP connection. `line` is held for a request and its answer; what is read are bytes that have come, if any did.

    Raises:
        OSError: nobody is there; of every method, the connection is gone.
    """

    quiet_until_s = 0.0

    def __init__(self, host: str, port: int, timeout_s: float) -> None:
        self._held, self._timeout_s = connect(host, port, timeout_s), timeout_s
        self.line = threading.RLock()

    @property
    def is_hung_up(self) -> bool:
        """Whether the device has closed it."""
        return is_hung_up(self._held)

    def write(self, data: bytes) -> None:
        """Send; what has come before belongs to nobody."""
        self.read(0.0)
        self._held.sendall(data)

    def read(self, wait_s: float) -> bytes:
        """What has come, waited for so long."""
        ready, _, _ = select.select([self._held], [], [], max(0.0, wait_s))
        came = self._held.recv(_MOST) if ready else b""
        if ready and not came:
            raise ConnectionResetError("the other side has closed it")
        return came

    def hold_nothing_back(self) -> None:
        """It is given up before anything else is sent on it, where that matters."""

    def drop(self) -> None:
        """Give it up: nothing more is sent on it."""
        close(self._held)

    def let_go(self) -> None:
        """Close it in order: whatever was sent was answered."""
        close(self._held, self._timeout_s)


def serial_port(place: Port, timeout_s: float, baud: int, parity: str, *, exclusive: bool | None) -> SharedPort:
    """The serial port at a place, that of all devices on its line.

    Raises:
        DeviceLostError: it is not there, another program has it, or another device has its name now.
    """
    path, speech = place.path(), {"baudrate": baud, "parity": parity}
    more: dict[str, Any] = {} if place.address.startswith("rfc2217:") else {"write_timeout": timeout_s}
    more |= {**speech, "timeout": min(timeout_s, _LOOK_S), "exclusive": exclusive}
    return shared_port(path, speech, lambda: _opened(place.address, path, timeout_s, more))


def _opened(address: str, path: str, timeout_s: float, more: dict[str, Any]) -> Any:
    import serial

    try:
        port = serial.serial_for_url(path, **more)
        guard_port(port, timeout_s)
        return port
    except Exception as error:  # pyserial raises its own, those of the system, and those of its protocols
        why = str(error).partition(f"ould not open port {path}: ")[2] or str(error)  # it names the port once more
        why = "another program has it" if getattr(error, "errno", None) == errno.EAGAIN else why
        raise DeviceLostError(f"{address}: cannot be opened: {why}") from error


def host_and_port(text: str) -> tuple[str, int] | None:
    """The two parts of `host:port`, None where it is none."""
    host, colon, port = text.rpartition(":")
    is_one = colon and re.fullmatch(r"[\w.:%\[\]-]+", host) and port.isdecimal() and 0 < int(port) < 65536
    return (host, int(port)) if is_one else None
