"""Whole numbers in bits of a device's counts, and counts that are no measurement."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from hil.description.terminal import counts_of, nan_of


@dataclass(frozen=True, slots=True)
class Part:
    """Where a whole number stands in a count, which it may fill.

    Attributes:
        lowest, width: its lowest bit and its number of bits.
        is_signed: whether it is a two's complement; a single bit never is.
    """

    lowest: int
    width: int
    is_signed: bool = False

    @property
    def mask(self) -> int:
        """Its bits of the count."""
        return (1 << self.width) - 1 << self.lowest

    def nearest(self, number: float) -> int:
        """What it holds of a number: the nearest, the end where that is beyond."""
        low = -self._sign
        return max(low, min(low + (1 << self.width) - 1, round(number)))

    def of(self, count: int) -> int:
        """The number in a count."""
        part = (count & self.mask) >> self.lowest
        return part - 2 * (part & self._sign)

    def put(self, number: int, count: int = 0) -> int:
        """A count with this number in it, and other bits as they are."""
        return count & ~self.mask | number << self.lowest & self.mask

    def why_none(self, number: float, invalid: Mapping[str, str]) -> str:
        """What a description says of a number, or of its bits, that is no measurement; empty where it says nothing."""
        if math.isnan(number):
            return nan_of(invalid)
        named = counts_of(invalid)
        bits = number & (1 << self.width) - 1 if isinstance(number, int) else number
        return next((named[int(key)] or f"count {int(key):#x}" for key in (number, bits) if key in named), "")

    @property
    def _sign(self) -> int:
        return 1 << self.width - 1 if self.is_signed and self.width > 1 else 0
