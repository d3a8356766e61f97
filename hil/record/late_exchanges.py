"""Samples for which a link took unusually long: within such an exchange nobody knows when the device acted or measured.

A sample over a link is stamped in the middle of its exchange (`Recording.stamps`). One that took as long as usual is a
part of the delay that estimators know. What it took beyond that may lie before or behind the moment that counts.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from hil.record.recording import Array, Mask, Recording

_APART_S = 1e-6  # stamps that a supposition brings together stay apart by so much


def late_exchanges(recording: Recording) -> Mask:
    """The samples whose exchanges took longer than usual by more than a sample interval, shape (n,)."""
    late = np.zeros(len(recording), dtype=np.bool_)
    for off_s in _off_s(recording).values():
        late |= 2.0 * off_s > recording.interval_s
    return late


def longest_exchange_s(recording: Recording) -> float:
    """How much longer than usual the longest of them took."""
    return 2.0 * max(float(np.max(off_s)) for off_s in _off_s(recording).values())


def with_supposed_times(recording: Recording, measured: Literal["early", "late"]) -> Recording:
    """The recording as if devices had measured at one end of each exchange, and acted at the other one.

    These are the shortest and the longest times between the two. No update is moved past that of
    another sample, and no reading past another one.
    """
    sign = 1.0 if measured == "late" else -1.0
    off_s, time_s = _off_s(recording), recording.time_s
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


def _off_s(recording: Recording) -> dict[str, Array]:
    """By channel of delays: how far from its stamp each reading may have been taken, beyond the usual."""
    delays = {name: recording.values(name, "s") for name in dict.fromkeys(recording.delay_channels.values())
              if name in recording.channels}  # fmt: skip
    return {name: np.maximum(delay_s - np.median(delay_s), 0.0) for name, delay_s in delays.items()}
