"""Bits of CAN messages, taken out and put in one by one; written without the library that drivers use for that."""

from __future__ import annotations

import struct
from typing import Any


def places(signal: Any) -> list[tuple[int, int]]:
    """(byte, bit) of each bit of a signal, the lowest first."""
    if signal.byte_order == "little_endian":
        return [divmod(signal.start + i, 8) for i in range(signal.length)]
    byte, bit = divmod(signal.start, 8)
    found = []
    for _ in range(signal.length):  # from the highest down: 7 … 0 of a byte, then on in the next
        found.append((byte, bit))
        byte, bit = (byte, bit - 1) if bit else (byte + 1, 7)
    return found[::-1]


def taken(signal: Any, data: bytes) -> float:
    """The count of a signal."""
    raw = sum((data[byte] >> bit & 1) << i for i, (byte, bit) in enumerate(places(signal)))
    if signal.is_float:
        size = signal.length // 8
        return float(struct.unpack({2: "<e", 4: "<f", 8: "<d"}[size], raw.to_bytes(size, "little"))[0])
    return raw - (1 << signal.length) if signal.is_signed and raw >> signal.length - 1 else raw


def put(signal: Any, data: bytearray, count: float) -> None:
    """Put the count of a signal into a message, at the end of what it holds where it is beyond."""
    if signal.is_float:
        size = signal.length // 8
        raw = int.from_bytes(struct.pack({2: "<e", 4: "<f", 8: "<d"}[size], count), "little")
    else:
        low = -(1 << signal.length - 1) if signal.is_signed else 0
        raw = max(low, min(low + (1 << signal.length) - 1, round(count))) & (1 << signal.length) - 1
    for i, (byte, bit) in enumerate(places(signal)):
        data[byte] = data[byte] & ~(1 << bit) | (raw >> i & 1) << bit
