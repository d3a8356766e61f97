"""A line of remembered values in a law's memory: m[0] counts steps, m[1] is the time of the newest."""

from __future__ import annotations

from typing import Any

from numba import njit

LENGTH = 4000
_START = 8


@njit(inline="always")
def remember(r: Any, x: float) -> None:
    """Write x as this step's value, once a step; the line starts full of the first."""
    if r.first == 1:
        if r.m[0] == 0.0:
            for i in range(LENGTH):
                r.m[_START + i] = x
        r.m[0] += 1.0
        r.m[1] = r.t
        r.m[_START + int(r.m[0]) % LENGTH] = x


@njit(inline="always")
def between(r: Any, steps_back: float, x: float) -> float:
    """Return the value `steps_back` before the newest, between two remembered ones; x itself if not in the past."""
    if steps_back <= 0.0:
        return x
    whole = int(steps_back)
    newer = r.m[_START + (int(r.m[0]) - whole) % LENGTH]
    older = r.m[_START + (int(r.m[0]) - whole - 1) % LENGTH]
    return newer + (steps_back - whole) * (older - newer)


@njit(inline="always")
def amend(r: Any, x: float) -> None:
    """Replace this step's value."""
    r.m[_START + int(r.m[0]) % LENGTH] = x
