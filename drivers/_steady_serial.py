"""Modbus on a serial line whose time-outs do not depend on the time of day."""

from __future__ import annotations

from typing import Any

from pymodbus.client import ModbusSerialClient
from pymodbus.exceptions import ConnectionException

from hil.daq.address import Port


class SteadySerialClient(ModbusSerialClient):
    """The serial client of pymodbus, which waits by the wall clock: when that is set back, it waits for so long.

    It opens its port again by itself, and only the same one.
    """

    def __init__(self, address: str, **settings: Any) -> None:
        super().__init__(address, **settings)
        self._place = Port(address)

    def connect(self) -> bool:
        """Open the port if it is not.

        Raises:
            DeviceLostError: it is not there, or another device has its name now.
        """
        if self.socket is None:
            self.comm_params.host = self._place.path()
        return bool(super().connect())

    def recv(self, size: int | None) -> bytes:
        """What has come, at least a byte; nothing when the time-out is over."""
        if self.socket is None:
            raise ConnectionException(str(self))
        try:
            return bytes(self.socket.read(size or max(1, self.socket.in_waiting)))
        except OSError:
            self.close()  # type: ignore[no-untyped-call]
            raise ConnectionException(str(self)) from None
