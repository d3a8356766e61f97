"""Modbus on a serial line whose time-outs do not depend on the time of day."""

from __future__ import annotations

from pymodbus.client import ModbusSerialClient
from pymodbus.exceptions import ConnectionException


class SteadySerialClient(ModbusSerialClient):
    """The serial client of pymodbus, which waits by the wall clock: when that is set back, it waits for so long."""

    def recv(self, size: int | None) -> bytes:
        """What has come, at least a byte; nothing when the time-out is over."""
        if self.socket is None:
            raise ConnectionException(str(self))
        try:
            return bytes(self.socket.read(size or max(1, self.socket.in_waiting)))
        except OSError:
            self.close()  # type: ignore[no-untyped-call]
            raise ConnectionException(str(self)) from None
