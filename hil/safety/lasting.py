"""How long a condition has held, sample by sample, across block borders."""

from __future__ import annotations

import numpy as np

from hil.record.recording import Array, Mask


def lasting_s(active: Mask, time_s: Array, since_s: float | None) -> tuple[Array, float | None]:
    """The time for which `active` has held without a break, at each sample, and since when it holds at the end.

    Args:
        active: the condition, shape (n,).
        time_s: stamps, shape (n,).
        since_s: since when it held at the end of the samples before; None when it did not.

    Returns:
        Durations, shape (n,), -1 where the condition does not hold; and `since_s` for the next samples.
    """
    if not np.count_nonzero(active):
        return np.full(len(active), -1.0), None
    index = np.arange(len(active))
    last_break = np.maximum.accumulate(np.where(active, -1, index))
    began_s = time_s[np.minimum(last_break + 1, len(active) - 1)]
    if since_s is not None:
        began_s[last_break < 0] = since_s
    held_s = np.where(active, time_s - began_s, -1.0)
    return held_s, float(began_s[-1]) if active[-1] else None
