"""Chance that repeats bit for bit: a number in [0, 1) from a key and a count, at any solver step."""

from __future__ import annotations

from numba import njit, uint64


@njit(inline="always")
def chance(key: float, count: float) -> float:
    """SplitMix64 (Steele, Lea, Flood, OOPSLA 2014) of key and count."""
    z = uint64(int(key * 1000.0)) * uint64(0x9E3779B97F4A7C15) + uint64(int(count) + 1) * uint64(0xD1B54A32D192ED03)
    z = (z ^ (z >> uint64(30))) * uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> uint64(27))) * uint64(0x94D049BB133111EB)
    z = z ^ (z >> uint64(31))
    return float(z >> uint64(11)) / 9007199254740992.0
