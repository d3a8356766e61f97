"""Channels that stand still for a while where their own noise says that they cannot: a sensor or device that repeats.

A channel that rests on one code of its converter, or is held at zero below a cut-off, does so wherever it rests. One
that is noisy at rest stands still only when nobody measures it.
"""

from __future__ import annotations

import numpy as np

from hil.language.note import Note
from hil.record.recording import Array, Mask, Recording
from hil.signals.rounding import rounding_step
from hil.signals.runs import longest_runs, runs
from hil.units import behind_a_number

_BY_CHANCE = 1e-3  # so often a run of equal readings may come by chance in a whole recording
_AROUND = 4  # how long the stretches are with which a run is compared, in its own length
_CODES = 2.0  # between readings at rest, at least: how often less noise moves them depends on where in a code it is
_FEWEST = 20  # readings at rest that tell how a channel rests
_MOST = 20  # of the longest runs of a channel; one that has more of them rests like that
_TURNS = 1.0 / 3.0  # of readings at rest are turning points where they are noise; of white noise two thirds


def frozen_channels(recording: Recording) -> tuple[Note, ...]:
    """A sentence for each time that a channel stood frozen: within a standing command, or across a change of it."""
    outputs = {*recording.meta.get("outputs", ()), recording.meta.get("roles", {}).get("command")}
    driven = [recording.channels[name].values for name in outputs if name in recording.channels]
    at_rest = np.logical_and.reduce([np.diff(values) == 0.0 for values in driven]) if driven else np.zeros(0, bool)
    others = outputs.union(recording.delay_channels.values())
    read = [name for name in recording.channels if name not in others] if at_rest.any() else []
    return tuple(
        _sentence(recording, name, first, stop)
        for name in read
        for first, stop in _frozen(recording.channels[name].values, at_rest)
    )


def _frozen(values: Array, at_rest: Mask) -> list[tuple[int, int]]:
    """(first, one past the last) reading of each run that chance does not explain."""
    finite, found = np.isfinite(values), []
    longest = longest_runs((values[1:] == values[:-1]) & finite[1:], _MOST)
    longest = [run for run in longest if not _is_short(len(at_rest), *run)]
    if not longest:
        return []
    steps, code = np.diff(np.where(finite, values, np.nan)), rounding_step(values[finite])
    for first, last in longest:
        is_within = last < len(steps) and at_rest[first : last + 1].all()  # the reading behind it counts too
        if (is_within or _is_across(values, at_rest, first, last)) and _is_frozen(steps, code, at_rest, first, last):
            found.append((first, last + 1))
    return sorted(found)


def _is_short(count: int, first: int, last: int) -> bool:
    """Whether chance explains a run even where none of the readings that it is compared with (`_is_frozen`) repeats."""
    return count * (_AROUND * (last - first) + 1.0) ** (first - last) >= _BY_CHANCE


def _is_across(values: Array, at_rest: Mask, first: int, last: int) -> bool:
    """Whether the command changes well within a run, at a value on which the channel does not rest elsewhere.

    A rest is left by the change of the command, or soon after; zero flow within an overlap comes again.
    """
    margin = max(2, (last - first) // _AROUND)
    if not first or at_rest[first + margin : last - margin].all():
        return False
    rests = runs((values[1:] == values[first]) & (values[:-1] == values[first]))
    return all(stop - start < margin for start, stop in rests if start != first)


def _is_frozen(steps: Array, code: float, at_rest: Mask, first: int, last: int) -> bool:
    rest = at_rest.copy()
    rest[first:last] = False
    others, same = steps[rest & np.isfinite(steps)], last - first
    if len(others) < min(same, _FEWEST) or np.median(np.abs(others)) < _CODES * code:
        return False
    if np.mean(np.diff(np.sign(others[others != 0.0])) != 0.0) < _TURNS:
        return False
    around = np.append(0, np.cumsum(others == 0.0))
    width = min(_AROUND * same, len(others))
    likely = (float(np.max(around[width:] - around[:-width])) + 1.0) / (width + 1.0)
    return bool(len(steps) * likely**same < _BY_CHANCE)


def _sentence(recording: Recording, name: str, first: int, stop: int) -> Note:
    channel, time_s = recording.channels[name], recording.time_s[first:stop]
    return Note(
        "'{channel}' stood at {value:.6g}{unit} in {n} samples, {first_s:.3f} … {last_s:.3f} s; at other rests it "
        "changes with each. Sensor, device or link repeated itself: nothing was measured there.",
        channel=name, value=channel.values[first], unit=behind_a_number(channel.unit), n=stop - first,
        first_s=time_s[0], last_s=time_s[-1],
    )  # fmt: skip
