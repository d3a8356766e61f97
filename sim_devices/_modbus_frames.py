"""Modbus as a device speaks it: frames on TCP and on a serial line, and the functions behind them.

Written after the protocol's specification and without the library that the drivers use, so that driver and
twin cannot share a mistake.
"""

from __future__ import annotations

import struct
from typing import Protocol

_LONGEST_PDU = 253


class Refused(Exception):
    """A request that is answered with an exception of Modbus."""

    def __init__(self, code: int) -> None:
        super().__init__(f"exception {code}")
        self.code = code


class Registers(Protocol):
    """What a device has; every access may raise `Refused`."""

    def input(self, address: int) -> int:
        """An input register."""
        ...

    def holding(self, address: int) -> int:
        """A holding register."""
        ...

    def coil(self, address: int) -> bool:
        """A coil."""
        ...

    def may_write(self, address: int, count: int) -> None:
        """Refuse a value that cannot be written."""
        ...

    def write(self, address: int, count: int) -> None:
        """Write a holding register."""
        ...

    def write_coil(self, address: int, on: bool) -> None:
        """Write a coil."""
        ...

    def heard(self) -> None:
        """A valid request came."""
        ...

    def restart(self) -> None:
        """Be as after power-on."""
        ...

    def tick(self) -> None:
        """Look at the clock."""
        ...


def answered(pdu: bytes, registers: Registers) -> bytes:
    """The answer to a request: function and data, without address and checksum."""
    function = pdu[0]
    try:
        return bytes([function]) + _data(function, pdu[1:], registers)
    except Refused as refused:
        return bytes([function | 0x80, refused.code])


def _data(function: int, data: bytes, registers: Registers) -> bytes:
    if function == 1:
        address, count = _two(data, most=2000)
        bits = [registers.coil(address + i) for i in range(count)]
        packed = bytes(sum(bit << k for k, bit in enumerate(bits[i : i + 8])) for i in range(0, count, 8))
        return bytes([len(packed)]) + packed
    if function in (3, 4):
        address, count = _two(data, most=125)
        read = registers.holding if function == 3 else registers.input
        words = [read(address + i) for i in range(count)]
        return struct.pack(f">B{count}H", 2 * count, *words)
    if function == 5:
        address, value = _words(data, 2)
        if value not in (0x0000, 0xFF00):
            raise Refused(3)
        registers.write_coil(address, value == 0xFF00)
        return data
    if function == 6:
        address, value = _words(data, 2)
        _write(registers, address, [value])
        return data
    if function == 16:
        return _write_many(data, registers)
    raise Refused(1)


def _write_many(data: bytes, registers: Registers) -> bytes:
    if len(data) < 5:
        raise Refused(3)
    address, count, size = struct.unpack(">HHB", data[:5])
    if not 1 <= count <= 123 or size != 2 * count or len(data) != 5 + size:
        raise Refused(3)
    _write(registers, address, list(struct.unpack(f">{count}H", data[5:])))
    return data[:4]


def _write(registers: Registers, address: int, values: list[int]) -> None:
    """All of a request or nothing."""
    for i, value in enumerate(values):
        registers.may_write(address + i, value)
    for i, value in enumerate(values):
        registers.write(address + i, value)


def _two(data: bytes, most: int) -> tuple[int, int]:
    address, count = _words(data, 2)
    if not 1 <= count <= most:
        raise Refused(3)
    return address, count


def _words(data: bytes, count: int) -> tuple[int, ...]:
    if len(data) != 2 * count:
        raise Refused(3)
    return struct.unpack(f">{count}H", data)


class _Frames:
    def __init__(self, registers: Registers, unit_id: int) -> None:
        self._registers = registers
        self._unit_id = unit_id

    def restart(self) -> None:
        """Be as after power-on."""
        self._registers.restart()

    def tick(self) -> None:
        """Look at the clock."""
        self._registers.tick()

    def _answered(self, pdu: bytes) -> bytes:
        self._registers.heard()
        return answered(pdu, self._registers)


class TcpFrames(_Frames):
    """Requests behind a header of transaction, protocol, length and unit."""

    def request_in(self, received: bytes) -> tuple[bytes, bytes]:
        """The first whole request, and what is left. After a header that makes no sense nothing is understood."""
        if len(received) < 8:
            return b"", received
        _, protocol, length = struct.unpack(">HHH", received[:6])
        if protocol != 0 or not 2 <= length <= _LONGEST_PDU + 1:
            return b"", b""
        whole = 6 + length
        return (b"", received) if len(received) < whole else (received[:whole], received[whole:])

    def answer(self, request: bytes) -> bytes:
        """The answer under the same transaction; none to another unit."""
        if request[6] not in (self._unit_id, 0xFF):
            return b""
        pdu = self._answered(request[7:])
        return request[:4] + struct.pack(">HB", len(pdu) + 1, request[6]) + pdu


class RtuFrames(_Frames):
    """Requests with the unit before and a checksum behind them; how long one is follows from its function."""

    def request_in(self, received: bytes) -> tuple[bytes, bytes]:
        """The first whole request whose checksum is right; what comes before it is passed over."""
        for first in range(len(received)):
            whole = _rtu_length(received[first:])
            if whole is None or len(received) - first < whole:
                return b"", received[first:]
            frame = received[first : first + whole]
            if crc16(frame[:-2]) == frame[-2:]:
                return frame, received[first + whole :]
        return b"", b""

    def answer(self, request: bytes) -> bytes:
        """The answer; none to another unit, nor to everybody (unit 0)."""
        if request[0] != self._unit_id:
            return b""
        frame = request[:1] + self._answered(request[1:-2])
        return frame + crc16(frame)


def _rtu_length(received: bytes) -> int | None:
    """How long the request is that begins here, None while that is not known."""
    if len(received) < 2:
        return None
    if received[1] in (15, 16):
        return None if len(received) < 7 else 9 + received[6]
    return 8


def crc16(frame: bytes) -> bytes:
    """The checksum of a frame on a serial line, low byte first."""
    crc = 0xFFFF
    for byte in frame:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return struct.pack("<H", crc)
