"""Times that step although the samples did not: clocks that were changed, counters that rolled over."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.arrays import Array

_HOUR = np.timedelta64(3600, "s")
_MINUTE = 60.0
_SUNDAY = 6  # clocks are changed on Sundays, in Europe and in America
_COUNTERS = (2.0**16, 2.0**32)  # what counters of a device hold


def shortest(stamp: np.datetime64) -> str:
    """A stamp without the digits that it does not need: 2025-03-30T03:00."""
    return str(np.datetime_as_string(stamp, unit="auto"))


def without_changed_clocks(stamps: NDArray[Any]) -> tuple[NDArray[Any], str]:
    """Stamps without the hour that clocks skip or repeat on a Sunday, and what was done, in words.

    Such an hour is one step that is, but for the distance of samples, an hour longer or shorter than the usual one.
    """
    steps = np.diff(stamps)
    if len(steps) < 2 or stamps.dtype.kind != "M" or (usual := np.median(steps)) >= _HOUR // 4:
        return stamps, ""
    sundays = (stamps[1:].astype("M8[D]").astype(np.int64) + 3) % 7 == _SUNDAY  # 1970 began on a Thursday
    for hour, word in ((_HOUR, "forward"), (-_HOUR, "back")):
        at = np.flatnonzero((np.abs(steps - usual - hour) <= usual // 2) & sundays)
        if len(at) == 1:
            later = np.arange(len(stamps)) > at[0]
            when = shortest(stamps[at[0] + 1])
            return stamps - later * hour, f"clocks went an hour {word} at {when}; that hour is taken out"
    return stamps, ""


def without_rollover(counts: Array) -> tuple[Array, str]:
    """Counts of a clock that begins anew where 16 or 32 bits are full, going on; and what was done, in words."""
    steps = np.diff(counts)
    if len(steps) < 2 or not (back := steps < 0.0).any() or not np.all(counts == np.round(counts)):
        return counts, ""
    usual = float(np.median(steps))
    for size in _COUNTERS:
        if usual > 0.0 and np.all(np.abs(steps[back] + size - usual) <= usual / 2.0):
            whole = np.concatenate(([0.0], np.cumsum(back)))
            return counts + size * whole, f"a counter of {np.log2(size):.0f} bits that rolled over goes on"
    return counts, ""


def with_minutes(numbers: Array) -> tuple[Array, str]:
    """Clocks written as one number in seconds, where only as such their steps are even; and what was done, in words."""
    minutes, seconds = numbers // 100.0, numbers % 100.0
    read = 3600.0 * (minutes // 100.0) + 60.0 * (minutes % 100.0) + seconds
    steps, written = np.diff(read), np.diff(numbers)
    if len(steps) < 2 or np.max(seconds) >= _MINUTE or np.max(minutes % 100.0) >= _MINUTE:
        return numbers, ""
    even = np.ptp(steps) <= np.median(steps) / 2.0 < np.ptp(written) / 2.0
    return (read, "clocks, as 101159.5 is 10:11:59.5") if even else (numbers, "")
