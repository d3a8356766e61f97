"""Converters: a voltage or current as so many bits can say it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hil.daq.channel import Kind
from hil.record.recording import Array


@dataclass(frozen=True, slots=True)
class Converter:
    """An ideal converter: `codes` levels, `lsb` apart, from `low` on; what is beyond ends at the last one.

    The numbers may be arrays of shape (k, 1), for k converters at once.
    """

    low: float | Array
    lsb: float | Array
    codes: float | Array

    @classmethod
    def of(cls, kind: Kind, low: float, high: float, bits: int, over: float = 0.0) -> Converter:
        """That of a channel, which reads `over` of its span more at either end; a digital line knows only its ends."""
        if kind == "digital":
            return cls(low, high - low, 2.0)
        codes = 2.0**bits
        lsb, more = (high - low) / codes, round(over * codes)
        return cls(low - more * lsb, lsb, codes + 2.0 * more)

    def convert(self, values: Array) -> Array:
        """The nearest levels, shape as given."""
        codes = values - self.low
        codes /= self.lsb
        np.rint(codes, out=codes)
        np.maximum(codes, 0.0, out=codes)
        np.minimum(codes, self.codes - 1.0, out=codes)
        codes *= self.lsb
        codes += self.low
        return codes
