"""Modbus as a device speaks it: frames on TCP and on a serial line, and the functions behind them.

Written after the protocol's specification and without the library that the drivers use, so that driver and
twin cannot share a mistake.
"""

# ruff: noqa: ARG002 - what a device has not is refused by methods that do nothing else

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from typing import Protocol

_LONGEST_PDU = 253
_EVERYBODY, _LAST_UNIT = 0, 247  # the first is obeyed on a serial line and not answered
_MOST_BITS, _MOST_WRITTEN_BITS, _MOST_WORDS, _MOST_WRITTEN_WORDS = 2000, 1968, 125, 123
COMMON = frozenset({1, 2, 3, 4, 5, 6, 15, 16})
"""Functions that most devices have; what is not among a device's own is refused with exception 1."""
# Length of a request on a serial line by function, checksum and all; or the place where it says so itself.
_LENGTHS = {**dict.fromkeys(range(1, 7), 8), 7: 4, 8: 8, 11: 4, 12: 4, 17: 4, 22: 10, 24: 6, 43: 7}
_COUNTED = {15: (6, 9), 16: (6, 9), 20: (2, 5), 21: (2, 5), 23: (10, 13)}


class Refused(Exception):
    """A request that is answered with an exception of Modbus."""

    def __init__(self, code: int) -> None:
        super().__init__(f"exception {code}")
        self.code = code


class Registers(Protocol):
    """What a device has; every access may raise `Refused`, as one does that a subclass leaves out.

    It may say which `functions` it has, by their codes (`COMMON` where it says nothing).
    """

    def input(self, address: int) -> int:
        """An input register."""
        raise Refused(2)

    def holding(self, address: int) -> int:
        """A holding register."""
        raise Refused(2)

    def output(self, address: int) -> int:
        """What a write to a holding register changes; some devices read something else at its address."""
        return self.holding(address)

    def coil(self, address: int) -> bool:
        """A coil."""
        raise Refused(2)

    def discrete(self, address: int) -> bool:
        """A discrete input."""
        raise Refused(2)

    def may_write(self, address: int, count: int) -> None:
        """Refuse a value that cannot be written."""
        raise Refused(2)

    def write(self, address: int, count: int) -> None:
        """Write a holding register."""
        raise Refused(2)

    def write_coil(self, address: int, on: bool) -> None:
        """Write a coil."""
        raise Refused(2)

    def heard(self) -> None:
        """A valid request came."""

    def restart(self) -> None:
        """Be as after power-on."""

    def tick(self) -> None:
        """Look at the clock."""


def answered(pdu: bytes, registers: Registers) -> bytes:
    """The answer to a request: function and data, without address and checksum."""
    function = pdu[0]
    try:
        return bytes([function]) + _data(function, pdu[1:], registers)
    except Refused as refused:
        return bytes([function | 0x80, refused.code])


def _data(function: int, data: bytes, registers: Registers) -> bytes:
    done = _FUNCTIONS.get(function)
    if done is None or function not in getattr(registers, "functions", COMMON):
        raise Refused(1)
    return done(data, registers)


def _read_bits(data: bytes, one: Callable[[int], bool]) -> bytes:
    address, count = _two(data, most=_MOST_BITS)
    bits = [one(address + i) for i in range(count)]
    packed = bytes(sum(bit << k for k, bit in enumerate(bits[i : i + 8])) for i in range(0, count, 8))
    return bytes([len(packed)]) + packed


def _read_words(data: bytes, one: Callable[[int], int]) -> bytes:
    address, count = _two(data, most=_MOST_WORDS)
    return struct.pack(f">B{count}H", 2 * count, *[one(address + i) for i in range(count)])


def _write_coil(data: bytes, registers: Registers) -> bytes:
    address, value = _words(data, 2)
    if value not in (0x0000, 0xFF00):
        raise Refused(3)
    registers.write_coil(address, value == 0xFF00)
    return data


def _write_one(data: bytes, registers: Registers) -> bytes:
    address, value = _words(data, 2)
    _write(registers, address, [value])
    return data


def _write_coils(data: bytes, registers: Registers) -> bytes:
    if len(data) < 5:
        raise Refused(3)
    address, count, size = struct.unpack(">HHB", data[:5])
    if not 1 <= count <= _MOST_WRITTEN_BITS or size != (count + 7) // 8 or len(data) != 5 + size:
        raise Refused(3)
    for i in range(count):
        registers.write_coil(address + i, bool(data[5 + i // 8] >> i % 8 & 1))
    return data[:4]


def _write_many(data: bytes, registers: Registers) -> bytes:
    if len(data) < 5:
        raise Refused(3)
    address, count, size = struct.unpack(">HHB", data[:5])
    if not 1 <= count <= _MOST_WRITTEN_WORDS or size != 2 * count or len(data) != 5 + size:
        raise Refused(3)
    _write(registers, address, list(struct.unpack(f">{count}H", data[5:])))
    return data[:4]


def _mask(data: bytes, registers: Registers) -> bytes:
    address, kept, set_ = _words(data, 3)
    _write(registers, address, [(registers.output(address) & kept) | (set_ & ~kept & 0xFFFF)])
    return data


def _write_and_read(data: bytes, registers: Registers) -> bytes:
    """Writes first, then reads."""
    if len(data) < 9:
        raise Refused(3)
    _two(data[:4], most=_MOST_WORDS)
    _write_many(data[4:], registers)
    return _read_words(data[:4], registers.holding)


_FUNCTIONS: Mapping[int, Callable[[bytes, Registers], bytes]] = {
    1: lambda data, registers: _read_bits(data, registers.coil),
    2: lambda data, registers: _read_bits(data, registers.discrete),
    3: lambda data, registers: _read_words(data, registers.holding),
    4: lambda data, registers: _read_words(data, registers.input),
    5: _write_coil,
    6: _write_one,
    15: _write_coils,
    16: _write_many,
    22: _mask,
    23: _write_and_read,
}


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
        self._events = 0  # requests that were carried out

    def restart(self) -> None:
        """Be as after power-on."""
        self._events = 0
        self._registers.restart()

    def tick(self) -> None:
        """Look at the clock."""
        self._registers.tick()

    def _answered(self, pdu: bytes) -> bytes:
        self._registers.heard()
        if pdu == b"\x0b" and pdu[0] in getattr(self._registers, "functions", COMMON):
            return struct.pack(">BHH", 11, 0, self._events & 0xFFFF)  # does not count itself
        answer = answered(pdu, self._registers)
        self._events += answer[0] < 0x80
        return answer


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
        """The answer under the same transaction; none to another unit. 0 and 255 mean the device itself."""
        if request[6] not in (self._unit_id, _EVERYBODY, 0xFF):
            return b""
        pdu = self._answered(request[7:])
        return request[:4] + struct.pack(">HB", len(pdu) + 1, request[6]) + pdu


class RtuFrames(_Frames):
    """Requests with the unit before and a checksum behind them; how long one is follows from its function."""

    def request_in(self, received: bytes) -> tuple[bytes, bytes]:
        """The first whole request whose checksum is right; what comes before it is passed over.

        A real device knows the end of a request by the silence behind it. Here it is where the checksum is right.
        """
        kept = len(received)
        for first in range(len(received) - 1):
            frame = received[first:]
            if frame[0] > _LAST_UNIT:
                continue
            if frame[1] not in _LENGTHS and frame[1] not in _COUNTED:
                if frame[0] not in (self._unit_id, _EVERYBODY):
                    continue
                whole = _checked_length(frame)
                kept = min(kept, first) if whole is None else kept
            else:
                whole = _rtu_length(frame)
                if whole is None or len(frame) < whole:
                    return b"", received[min(kept, first) :]
                whole = whole if crc16(frame[: whole - 2]) == frame[whole - 2 : whole] else None
            if whole is not None:
                return frame[:whole], frame[whole:]
        return b"", received[min(kept, max(len(received) - 1, 0)) :]

    def answer(self, request: bytes) -> bytes:
        """The answer; none to another unit. What is told to everybody (unit 0) is done and not answered."""
        if request[0] not in (self._unit_id, _EVERYBODY):
            return b""
        frame = request[:1] + self._answered(request[1:-2])
        return b"" if request[0] == _EVERYBODY else frame + crc16(frame)


def _rtu_length(received: bytes) -> int | None:
    """How long the request is that begins here, None while that is not known."""
    if received[1] in _LENGTHS:
        return _LENGTHS[received[1]]
    place, more = _COUNTED[received[1]]
    return None if len(received) <= place else more + received[place]


def _checked_length(received: bytes) -> int | None:
    """Where a checksum is right, for a function of which nothing is known."""
    longest = min(len(received), _LONGEST_PDU + 3)
    return next((n for n in range(4, longest + 1) if crc16(received[: n - 2]) == received[n - 2 : n]), None)


def crc16(frame: bytes) -> bytes:
    """The checksum of a frame on a serial line, low byte first."""
    crc = 0xFFFF
    for byte in frame:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return struct.pack("<H", crc)
