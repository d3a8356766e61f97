"""Samples for which a link took unusually long: within such an exchange nobody knows when the device acted or measured.

A sample over a link is stamped in the middle of its exchange (`Recording.stamps`). One that took as long as usual is a
part of the delay that estimators know. What it took beyond that may lie before or behind the moment that counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hil.record.recording import Array, Recording

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
    """What a recording has of late exchanges; None where it has none."""
    delays = {name: recording.values(name, "s") for name in dict.fromkeys(recording.delay_channels.values())
              if name in recording.channels}  # fmt: skip
    # how far from its stamp each reading may have been taken, beyond the usual
    off_s = {name: np.maximum(delay_s - np.median(delay_s), 0.0) for name, delay_s in delays.items()}
    longest_s = 2.0 * np.max(list(off_s.values()), axis=0, initial=0.0)
    late = longest_s > recording.interval_s
    if not late.any():
        return None
    early, at_the_end = (_with_supposed_times(recording, off_s, sign) for sign in (-1.0, 1.0))
    return LateExchanges(int(np.count_nonzero(late)), float(np.max(longest_s)), early, at_the_end)


def _with_supposed_times(recording: Recording, off_s: Mapping[str, Array], sign: float) -> Recording:
    """Readings as far behind their stamps as they may be (1), or before (-1), and commands the other way.

    No update is moved past that of another sample, and no reading past another one.
    """
    time_s = recording.time_s
    read_s = {name: time_s + recording.values(name) for name in off_s}
    before_s = np.append(-np.inf, np.max(list(read_s.values()), axis=0)[:-1] + _APART_S)
    behind_s = np.append(time_s[1:], np.inf)
    first_s, least_s = np.min(list(read_s.values()), axis=0), np.min(list(off_s.values()), axis=0)
    acted_s = np.clip(time_s - sign * least_s, np.minimum(before_s, time_s), np.maximum(first_s, time_s))
    channels = dict(recording.channels)
    for name, at_s in read_s.items():
        moved_s = np.clip(at_s + sign * off_s[name], np.minimum(time_s, at_s), np.maximum(behind_s, at_s))
        channels[name] = replace(channels[name], values=moved_s - acted_s)
    return replace(recording, time_s=acted_s, channels=channels)
