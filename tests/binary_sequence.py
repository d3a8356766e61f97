"""Pseudo-random binary sequences."""

from __future__ import annotations

import numpy as np

from hil.record.recording import Array


def binary_sequence(low: float, high: float, clock_s: float, rate_hz: float, *, bits: int, periods: int = 1) -> Array:
    """A maximum-length sequence of 2^bits − 1 clocks per period; its spectrum is flat up to about 0.44/clock."""
    from scipy.signal import max_len_seq  # a tenth of what it takes to collect all tests

    sequence = max_len_seq(bits, state=[1] + [0] * (bits - 1))[0]
    return np.tile(np.repeat(low + (high - low) * sequence, round(clock_s * rate_hz)), periods)
