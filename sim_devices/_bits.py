"""Numbers in bytes, bit by bit; written without what drivers use for that, so that a slip shows."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass

_REALS = {16: "<e", 32: "<f", 64: "<d"}


@dataclass(frozen=True, slots=True)
class Bits:
    """Where the bits of a number stand.

    Attributes:
        places: (byte, bit) of each, the lowest first.
        is_signed: whether they are a two's complement.
        is_real: whether they are a floating-point number of IEEE 754.
    """

    places: tuple[tuple[int, int], ...]
    is_signed: bool = False
    is_real: bool = False

    def taken(self, data: Sequence[int]) -> float:
        """The number in some bytes."""
        raw, size = sum((data[byte] >> bit & 1) << i for i, (byte, bit) in enumerate(self.places)), len(self.places)
        if self.is_real:
            return float(struct.unpack(_REALS[size], raw.to_bytes(size // 8, "little"))[0])
        return raw - (1 << size) if self.is_signed and raw >> size - 1 else raw

    def put(self, data: bytearray, number: float, none: int = 0) -> None:
        """Put a number into bytes, at the end of what it holds where it is beyond; `none` where it is not a number."""
        size = len(self.places)
        low = -(1 << size - 1) if self.is_signed else 0
        if self.is_real:
            raw = int.from_bytes(struct.pack(_REALS[size], number), "little")
        else:
            raw = none if math.isnan(number) else max(low, min(low + (1 << size) - 1, round(number)))
        for i, (byte, bit) in enumerate(self.places):
            data[byte] = data[byte] & ~(1 << bit) | (raw >> i & 1) << bit
