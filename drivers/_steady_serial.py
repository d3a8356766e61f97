"""Modbus on a serial line whose time-outs do not depend on the time of day."""

from __future__ import annotations

import errno
from contextlib import suppress
from typing import Any

import serial
from pymodbus.client import ModbusSerialClient
from pymodbus.exceptions import ConnectionException

from drivers._edge import guard_port
from drivers._shared_port import keep_quiet, quiet_until_s, shared_port
from hil.daq.address import Port
from hil.errors import DeviceLostError


class SteadySerialClient(ModbusSerialClient):
    """The serial client of pymodbus, which waits by the wall clock: when that is set back, it waits for so long.

    It opens its port again by itself, and only the same one. Devices on one line have one port.
    """

    def __init__(self, address: str, **settings: Any) -> None:
        super().__init__(address, **settings)
        self._address, self._place, self._path = address, Port(address), address

    def connect(self) -> bool:
        """Open the port if it is not.

        Raises:
            DeviceLostError: it is not there, another program has it, or another device has its name now.
        """
        if self.socket is None:
            self._path = path = self._place.path()
            params = self.comm_params
            speech = {"baudrate": params.baudrate, "parity": params.parity, "stopbits": params.stopbits}
            self.socket = shared_port(path, speech, lambda: self._opened(path))  # type: ignore[assignment]
        return True

    def execute(self, no_response_expected: bool, request: Any) -> Any:
        """A request and its answer, while nobody else speaks on the line."""
        self.connect()
        with self.socket.line:  # type: ignore[union-attr]
            return super().execute(no_response_expected, request)

    def close(self) -> None:
        """Give the port up: what still waits in it to be sent is not."""
        if self.socket is not None:
            with suppress(Exception):
                self.socket.reset_output_buffer()
        super().close()  # type: ignore[no-untyped-call]

    def let_go(self) -> None:
        """Close it in order: what was sent goes out."""
        super().close()  # type: ignore[no-untyped-call]

    @property
    def quiet_until_s(self) -> float:
        """Until when nobody asks on this line."""
        return quiet_until_s(self._path)

    @quiet_until_s.setter
    def quiet_until_s(self, until_s: float) -> None:
        keep_quiet(self._path, until_s)

    def _opened(self, path: str) -> serial.Serial:
        params = self.comm_params
        try:
            port: serial.Serial = serial.serial_for_url(
                path, params.baudrate, params.bytesize, params.parity, params.stopbits, params.timeout_connect,
                write_timeout=params.timeout_connect, exclusive=True,
            )  # fmt: skip
            guard_port(port, params.timeout_connect or 0.0)
            return port
        except Exception as error:  # pyserial raises its own, those of the system, and those of its protocols
            why = "another program has it" if getattr(error, "errno", None) == errno.EAGAIN else str(error)
            raise DeviceLostError(f"{self._address}: cannot be opened: {why}") from error

    def recv(self, size: int | None) -> bytes:
        """What has come, at least a byte; nothing when the time-out is over."""
        if self.socket is None:
            raise ConnectionException(str(self))
        try:
            return bytes(self.socket.read(size or max(1, self.socket.in_waiting)))
        except OSError:
            self.close()
            raise ConnectionException(str(self)) from None
