"""Pseudo-random binary sequences."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hil.errors import SettingError

Array = NDArray[np.float64]


def binary_sequence(low: float, high: float, clock_s: float, rate_hz: float, *, bits: int, periods: int = 1) -> Array:
    """A maximum-length pseudo-random binary sequence (PRBS) of 2^bits − 1 clocks per period.

    Its spectrum is flat up to about 0.44/clock.

    Raises:
        SettingError: bits outside 2…16, or a clock shorter than one sample.
    """
    from scipy.signal import max_len_seq  # a second

    samples = round(clock_s * rate_hz)
    if not (2 <= bits <= 16 and samples >= 1):
        raise SettingError(
            f"PRBS: {bits} bits, {samples} samples per clock; allowed are 2…16 bits and at least one sample"
        )
    sequence = max_len_seq(bits, state=[1] + [0] * (bits - 1))[0]
    return np.tile(np.repeat(low + (high - low) * sequence, samples), periods)
