"""Bytes to a device and back: on TCP, or on a serial port that all devices of its line share."""

from __future__ import annotations

import errno
import re
from typing import Any

from drivers._edge import guard_port
from drivers._shared_port import SharedPort, shared_port
from hil.daq.address import Port
from hil.errors import DeviceLostError
from hil.system import system
from hil.system.tcp import TcpConnection

_LOOK_S = 0.02  # how often the clock is looked at while an answer is waited for


class TcpPort:
    """A TCP connection, used as `drivers._shared_port.SharedPort`.

    `line` is held for a request and its answer; what is read are bytes that have come, if any did.

    Raises:
        OSError: nobody is there; of every method, the connection is gone.
    """

    quiet_until_s = 0.0

    def __init__(self, host: str, port: int, timeout_s: float) -> None:
        self._held = TcpConnection(host, port, timeout_s)
        self.read, self.drop, self.let_go = self._held.read, self._held.drop, self._held.let_go
        self.line = system.rlock()

    @property
    def is_hung_up(self) -> bool:
        """Whether the device has closed it."""
        return self._held.is_hung_up

    def write(self, data: bytes) -> None:
        """Send; what has come before belongs to nobody."""
        self.read(0.0)
        self._held.write(data)

    def hold_nothing_back(self) -> None:
        """It is given up before anything else is sent on it, where that matters."""


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
    try:
        port = system.serial(path, **more)
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
