"""A recording for formats with one row per sample: channels of several rates on the union of their stamps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hil.record.recording import SAME_STAMP, Array, Recording, Samples

_EVEN = 0.05


def resampled(recording: Recording) -> Recording:
    """The recording on the stamps of all its samples together.

    A channel that was sampled on change holds its value; an evenly sampled one has NaN where it was not sampled, so
    that nobody takes what stands there for a measurement.
    """
    if not recording.own:
        return recording
    time_s = recording.time_s
    for taken in recording.own.values():
        time_s = _united(time_s, taken.time_s)
    channels = {
        name: replace(channel, values=_spread(time_s, recording.samples(name)))
        for name, channel in recording.channels.items()
    }
    return replace(recording, time_s=time_s, channels=channels, own={})


def _united(time_s: Array, others: Array) -> Array:
    within = others[(others >= time_s[0]) & (others <= time_s[-1])]
    slack = SAME_STAMP * float(np.median(np.diff(time_s)))
    new = within[np.abs(within - time_s[_nearest(time_s, within)]) > slack]
    return np.union1d(time_s, new) if new.size else time_s


def _spread(time_s: Array, taken: Samples) -> Array:
    if np.array_equal(taken.time_s, time_s):
        return taken.values
    steps = np.diff(taken.time_s)
    even = len(steps) > 8 and bool(np.quantile(np.abs(steps - np.median(steps)), 0.9) <= _EVEN * np.median(steps))
    if not even:
        return taken.held_at(time_s)
    made = np.full(len(time_s), np.nan)
    within = (taken.time_s >= time_s[0]) & (taken.time_s <= time_s[-1])
    made[_nearest(time_s, taken.time_s[within])] = taken.values[within]
    return made


def _nearest(time_s: Array, wanted: Array) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    after = np.clip(np.searchsorted(time_s, wanted), 1, len(time_s) - 1)
    closer = wanted - time_s[after - 1] < time_s[after] - wanted
    return np.where(closer, after - 1, after).astype(np.intp)
