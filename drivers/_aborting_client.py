"""Modbus over a TCP connection that ends when it is given up."""

from __future__ import annotations

from typing import Any

from pymodbus.client import ModbusTcpClient

from hil.daq.connection import close, connect


class AbortingTcpClient(ModbusTcpClient):
    """The TCP client of pymodbus on a socket of ours (see `hil.daq.connection`)."""

    def __init__(self, host: str, **settings: Any) -> None:
        super().__init__(host, **settings)
        self._timeout_s = float(settings["timeout"])

    def connect(self) -> bool:
        """Connect unless it is; whether it is now."""
        if self.socket is None:
            try:
                self.socket = connect(self.comm_params.host, int(self.comm_params.port), self._timeout_s)
            except OSError:
                return False
        return True

    def close(self) -> None:
        """Give the connection up: nothing more is sent on it."""
        held, self.socket = self.socket, None
        if held is not None:
            close(held)

    def let_go(self) -> None:
        """Close it in order: whatever was sent was answered."""
        held, self.socket = self.socket, None
        if held is not None:
            close(held, self._timeout_s)
