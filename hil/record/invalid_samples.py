"""Samples of a recording that are no measurements, and what can still be said without them.

A device that has no valid reading, or one at the end of its range, has not measured. In a run folder such a sample is
no finite number: NaN, or plus or minus infinity where the quantity was at that end of the range or beyond it. The
events `reading at the end of its range` and `no measurement` say when it began and name the range.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from hil.errors import FileError
from hil.language.note import Note
from hil.record.parts import moved
from hil.record.recording import Array, Channel, Mask, Recording

INVALID_SAMPLES = "unmeasured"
"""Key of a recording's header: what was not measured, a sentence for each channel."""
AT_END, NONE, AGAIN = "reading at the end of its range", "no measurement", "measured again"
"""Names of events: a channel stops being measured, for either reason, and is measured again."""


def notes_of_reading(meta: Mapping[str, Any]) -> list[str]:
    """What was assumed when a source with this header was read, what was not measured, and which units it lacks."""
    lacking = tuple(f"'{name}'" for name in meta.get("units_missing", ()))
    units = [Note("no unit is stated for {channels}; taken as 1", channels=lacking)] if lacking else []
    return [*meta.get("assumed", ()), *meta.get(INVALID_SAMPLES, ()), *units]


def is_measured(values: Array) -> bool:
    """Whether each of these is a number."""
    return bool(np.isfinite(values).all())


def invalid_samples(recording: Recording) -> dict[str, Mask]:
    """By channel, the samples that are no measurements; channels without such are left out."""
    return {
        name: ~np.isfinite(channel.values)
        for name, channel in recording.channels.items()
        if not is_measured(channel.values)
    }


def invalid_note(recording: Recording, name: str, lacking: Mask) -> Note:
    """`'flow' was not measured in 120 of 3000 samples (at the end of its range or beyond), 3.2 … 4.4 s`."""
    values, time_s = recording.channels[name].values[lacking], recording.time_s[lacking]
    at_end = np.isinf(values).all()
    return Note(
        "'{channel}' was not measured in {n} of {all} samples ({why}), {first_s:.3f} … {last_s:.3f} s",
        channel=name, n=len(values), all=len(recording), first_s=time_s[0], last_s=time_s[-1],
        why=Note("at the end of its range or beyond") if at_end else Note("no valid reading"),
    )  # fmt: skip


def with_blanks(recording: Recording) -> Recording:
    """The recording with NaN for each sample that is no measurement; without channels that were never measured.

    `meta[INVALID_SAMPLES]` says what was not measured, a sentence for each channel.

    Raises:
        FileError: no channel was ever measured.
    """
    lacking = invalid_samples(recording)
    if not lacking:
        return recording
    notes = [invalid_note(recording, name, mask) for name, mask in lacking.items()]
    channels = {
        name: channel if name not in lacking else replace(channel, values=_blanked(channel.values, lacking[name]))
        for name, channel in recording.channels.items()
        if name not in lacking or not lacking[name].all()
    }
    if not channels:
        raise FileError(f"{recording.name}: {'; '.join(notes)}")
    return replace(recording, channels=channels, meta={**recording.meta, INVALID_SAMPLES: notes})


def _blanked(values: Array, lacking: Mask) -> Array:
    return np.where(lacking, np.nan, values)


def measured_rows(recording: Recording, names: Iterable[str]) -> Recording:
    """The rows in which each of these channels was measured.

    Raises:
        FileError: fewer than two rows are left.
    """
    named = [name for name in names if name in recording.channels]
    lacking = {name: ~np.isfinite(recording.channels[name].values) for name in named if name not in recording.own}
    if not any(mask.any() for mask in lacking.values()):
        return recording
    rows = ~np.logical_or.reduce(list(lacking.values()))
    if np.count_nonzero(rows) < 2:
        notes = [invalid_note(recording, name, mask) for name, mask in lacking.items() if mask.any()]
        raise FileError(f"{recording.name}: no two rows in which all that is used was measured: {'; '.join(notes)}")
    before = np.concatenate(([0], np.cumsum(rows)))  # rows that are left, before each
    time_s = recording.time_s[rows]
    meta = moved(recording.meta, lambda row: int(before[min(row, len(recording))]), time_s)
    channels = {name: replace(channel, values=channel.values[rows]) for name, channel in recording.channels.items()}
    return replace(recording, time_s=time_s, channels=channels, meta=meta)


def across(values: Array) -> tuple[Array, Mask]:
    """Numbers in place of samples that are no measurements, straight from one that is one to the next; and which."""
    lacking = ~np.isfinite(values)
    if not lacking.any():
        return values, lacking
    if lacking.all():
        return np.zeros_like(values), lacking
    at = np.arange(len(values))
    return np.interp(at, at[~lacking], values[~lacking]), lacking


def supposed(recording: Recording, where: Literal["near", "far"]) -> Recording:
    """The recording with a number for each sample that is no measurement: for finding out what rests on them.

    Beyond an end of the range the number is that end (`near`), or a whole range further (`far`). Where nothing was
    read it lies between the neighbours that were measured (`near`), or at the upper end of the range (`far`).
    """
    channels = dict(recording.channels)
    for name, lacking in invalid_samples(recording).items():
        low, high = _range(recording, name)
        channels[name] = replace(channels[name], values=_supposed(channels[name], lacking, low, high, where))
    return replace(recording, channels=channels)


def _supposed(channel: Channel, lacking: Mask, low: float, high: float, where: str) -> Array:
    values, further = channel.values, high - low if where == "far" else 0.0
    number = np.flatnonzero(~lacking)
    gaps = np.full(len(values), high)
    if where == "near":
        gaps = np.interp(np.arange(len(values)), number, values[number]) if len(number) else np.full(len(values), low)
    gaps = np.where(np.isposinf(values), high + further, np.where(np.isneginf(values), low - further, gaps))
    return np.where(lacking, gaps, values)


def _range(recording: Recording, name: str) -> tuple[float, float]:
    """The channel's range, as its events name it, else as far as its values go."""
    for event in recording.meta.get("events", ()):
        details = event.get("details", {})
        if event.get("event") in (AT_END, NONE) and details.get("channel") == name:
            return float(details["low"]), float(details["high"])
    values = recording.channels[name].values
    numbers = values[np.isfinite(values)]
    low, high = (float(numbers.min()), float(numbers.max())) if len(numbers) else (0.0, 1.0)
    return low, high if high > low else low + 1.0
