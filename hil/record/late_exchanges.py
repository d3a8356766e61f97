"""Samples for which a link took unusually long: within such an exchange nobody knows when the device acted or measured.

A sample over a link is stamped in the middle of its exchange (`Recording.stamps`). One that took as long as usual is a
part of the delay that estimators know. What it took beyond that may lie before or behind the moment that counts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hil.record.recording import Recording

_APART_S = 1e-6  # stamps that a supposition brings together stay apart by so much


@dataclass(frozen=True, slots=True, eq=False)
class LateExchanges:
    """Exchanges of a recording that took longer than usual by more than a sample interval.

    Attributes:
        count: of their samples.
        longest_s: how much longer than usual the longest took.
        early, late: the recording as if devices had measured at one end of each exchange, and acted at the other one.
            These are the shortest and the longest times between the two.
    """

    count: int
    longest_s: float
    early: Recording
    late: Recording


def late_exchanges(recording: Recording) -> LateExchanges | None:
    """What a recording has of late exchanges; None where it has none.

    No update is supposed to be past that of another sample, and no reading past another one.
    """
    delays_s = {name: recording.values(name, "s") for name in dict.fromkeys(recording.delay_channels.values())
                if name in recording.channels}  # fmt: skip
    # how far from its stamp each reading may have been taken, beyond the usual
    off_s = {name: np.maximum(delay_s - np.median(delay_s), 0.0) for name, delay_s in delays_s.items()}
    longest_s = 2.0 * np.max(list(off_s.values()), axis=0, initial=0.0)
    is_late = longest_s > recording.interval_s
    if not is_late.any():
        return None
    time_s, supposed = recording.time_s, []
    read_s = {name: time_s + delay_s for name, delay_s in delays_s.items()}
    before_s = np.append(-np.inf, np.max(list(read_s.values()), axis=0)[:-1] + _APART_S)
    behind_s = np.append(time_s[1:], np.inf)
    first_s, least_s = np.min(list(read_s.values()), axis=0), np.min(list(off_s.values()), axis=0)
    for sign in (-1.0, 1.0):
        acted_s = np.clip(time_s - sign * least_s, np.minimum(before_s, time_s), np.maximum(first_s, time_s))
        channels = dict(recording.channels)
        for name, at_s in read_s.items():
            moved_s = np.clip(at_s + sign * off_s[name], np.minimum(time_s, at_s), np.maximum(behind_s, at_s))
            channels[name] = replace(channels[name], values=moved_s - acted_s, unit="s")
        supposed.append(replace(recording, time_s=acted_s, channels=channels))
    return LateExchanges(int(np.count_nonzero(is_late)), float(np.max(longest_s)), *supposed)
