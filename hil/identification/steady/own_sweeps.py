"""Slow sweeps in a recording that no procedure wrote: where the command rises and falls, and where it waits.

A sweep is a command that goes up and down over one range at an even speed. Between two turns it may stand still;
what the response is there, at an end, belongs to the curve as well.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hil.arrays import ROUNDING
from hil.errors import InputError
from hil.identification.steady.criteria import CRITERIA
from hil.identification.steady.sweep_estimate import Standing, Sweep, settled
from hil.identification.uncertainty.fit import rms
from hil.language.note import Note
from hil.record.recording import Array, Recording
from hil.signals.runs import runs


@dataclass(frozen=True, slots=True)
class Branch:
    """Samples first…last (exclusive) in which the command goes one way at an even speed, per second."""

    first: int
    last: int
    speed_per_s: float

    @property
    def samples(self) -> slice:
        """As an index."""
        return slice(self.first, self.last)


@dataclass(frozen=True, slots=True)
class OwnSweeps:
    """The sweeps of recordings, one for each speed, fastest first, and the waits at the ends of their range.

    Attributes:
        sweeps: with the command as the straight lines that it follows.
        standing: at the lower and the upper end, as far as the command waited there.
        at_rest: (mean response, its standard uncertainty) while the command waited at neutral; None where it did not.
        notes: what of the recordings is no sweep, and where the command went one way alone.
    """

    sweeps: tuple[Sweep, ...]
    standing: tuple[Standing, ...]
    at_rest: tuple[float, float] | None
    notes: tuple[Note, ...] = ()


_Way = tuple[float, Array, Array]  # speed with its sign, command, response


def own_sweeps(recordings: Sequence[Recording], input_name: str, output_name: str, neutral: float = 0.0) -> OwnSweeps:
    """The sweeps that recordings hold together.

    Raises:
        InputError: one holds no sweep, or at no speed both the way up and the way down.
    """
    ways: list[_Way] = []
    standing: list[Standing] = []
    rests: list[tuple[float, float]] = []
    for recording in recordings:
        command, response = recording.values(input_name), recording.values(output_name)
        found = branches(recording.time_s, command)
        if not found:
            raise InputError(
                f"{recording.name}: no sweep in channel '{input_name}': a ramp up and down of at least "
                f"{CRITERIA.fewest_samples} samples each; `hil analyse step` knows steps, `hil analyse sines` sines"
            )
        ways += [(one.speed_per_s, _line(recording.time_s, command, one), response[one.samples]) for one in found]
        standing += _at_ends(command, response)
        rests += [(value, std) for value, std, _ in _waits(command, response, neutral)]
    groups = _by_speed(ways)
    pairs = [group for group in groups if _goes_both_ways(group)]
    if not pairs:
        raise InputError(f"{recordings[0].name}: {_lacking(recordings, input_name, ways)}")
    unit = recordings[0].channel(input_name).unit
    commands = np.concatenate([one.values(input_name) for one in recordings])
    notes = [*_beyond(commands, pairs, unit), *_one_way(pairs, unit), *_unpaired(groups, unit)]
    return OwnSweeps(tuple(map(_sweep, pairs)), tuple(standing), rests[0] if rests else None, tuple(notes))


def branches(time_s: Array, command: Array) -> list[Branch]:
    """Where a command goes one way along a straight line, between its turns and its waits."""
    span = float(np.ptp(command))
    if span == 0.0:
        return []
    edges = _turns(command, CRITERIA.turn * span)
    found = [_moving(time_s, command, first, last, span) for first, last in pairwise(edges)]
    return [one for one in found if one is not None]


def _turns(command: Array, back: float) -> list[int]:
    """Places of the extremes from which the command comes back by more than `back`, with both ends."""
    found, extreme, place, direction = [0], float(command[0]), 0, 0
    for i, value in enumerate(command.tolist()):
        away = value - extreme
        if direction == 0 and abs(away) > back:
            direction = 1 if away > 0.0 else -1
        if direction and away * direction >= 0.0:
            extreme, place = value, i
        elif direction and abs(away) > back:
            found.append(place)
            extreme, place, direction = value, i, -direction
    return [*found, len(command) - 1]


def _moving(time_s: Array, command: Array, first: int, last: int, span: float) -> Branch | None:
    """The branch between two turns without the waits at its ends; None where it is no ramp."""
    part = command[first : last + 1]
    low, high = min(part[0], part[-1]), max(part[0], part[-1])
    inside = np.flatnonzero((part > low + CRITERIA.stands * span) & (part < high - CRITERIA.stands * span))
    if high - low < CRITERIA.branch * span or len(inside) < CRITERIA.fewest_samples:
        return None
    moving = slice(first + int(inside[0]), first + int(inside[-1]) + 1)
    slope, level = np.polyfit(time_s[moving], command[moving], 1)
    off = rms(command[moving] - level - slope * time_s[moving])
    if off > CRITERIA.straight * span or abs(slope) * np.ptp(time_s[moving]) < (1.0 - 2.0 * CRITERIA.turn) * (
        high - low
    ):
        return None
    ends_s = np.sort((np.array([part[0], part[-1]]) - level) / slope)
    begin, end = np.searchsorted(time_s, ends_s + np.array([-ROUNDING, ROUNDING]) * np.ptp(ends_s))
    return Branch(max(int(begin), first), min(int(end), last + 1), float(slope))


def _line(time_s: Array, command: Array, branch: Branch) -> Array:
    """The command of a branch as the line that it follows: noise of a measured command turns no sample back."""
    late = time_s[branch.samples] - time_s[branch.first]
    slope, level = np.polyfit(late, command[branch.samples], 1)
    return level + slope * late


def _by_speed(ways: Sequence[_Way]) -> list[list[_Way]]:
    """Branches of one speed together, whichever way they go, the fastest first."""
    groups: list[list[_Way]] = []
    for way in sorted(ways, key=lambda one: -abs(one[0])):
        if groups and abs(way[0]) >= (1.0 - CRITERIA.same_speed) * abs(groups[-1][0][0]):
            groups[-1].append(way)
        else:
            groups.append([way])
    return groups


def _goes_both_ways(group: Sequence[_Way]) -> bool:
    return len({speed > 0.0 for speed, _, _ in group}) == 2


def _sweep(group: Sequence[_Way]) -> Sweep:
    return Sweep(
        np.concatenate([command for _, command, _ in group]), np.concatenate([answer for _, _, answer in group]),
        float(np.mean([abs(speed) for speed, _, _ in group])),
    )  # fmt: skip


def _lacking(recordings: Sequence[Recording], input_name: str, ways: Sequence[_Way]) -> str:
    """Why branches make no sweep, and what to record."""
    unit = recordings[0].channel(input_name).unit
    if _goes_both_ways(ways):
        up, down = (next(abs(one[0]) for one in ways if (one[0] > 0.0) is rises) for rises in (True, False))
        return f"the command rises at {up:.3g} and falls at {down:.3g} {unit}/s; a sweep goes both ways at one speed"
    sign, found, lacking = (1.0, "rising", "falling") if ways[0][0] > 0.0 else (-1.0, "falling", "rising")
    commands = [sign * one.values(input_name) for one in recordings]
    back = max(float(np.max(np.maximum.accumulate(one) - one)) for one in commands)
    if back > CRITERIA.branch * max(float(np.ptp(one)) for one in commands):
        return (
            f"no {lacking} ramp beside the {found} one: from turn to turn a ramp goes on at an even speed, without a "
            "wait; cut the recording, or record it so"
        )
    return (
        f"the command only {'rises' if sign > 0.0 else 'falls'}; the {lacking} sweep over the same range is missing: "
        "record it at the same speed and give both recordings"
    )


def _reach(ways: Iterable[_Way]) -> tuple[float, float]:
    ends = np.array([(command.min(), command.max()) for _, command, _ in ways])
    return float(ends[:, 0].min()), float(ends[:, 1].max())


def _beyond(commands: Array, pairs: Sequence[Sequence[_Way]], unit: str) -> list[Note]:
    """Where the command goes further than its sweeps."""
    ends, swept = (float(commands.min()), float(commands.max())), _reach(one for group in pairs for one in group)
    if max(swept[0] - ends[0], ends[1] - swept[1]) <= CRITERIA.side * (ends[1] - ends[0]):
        return []
    return [
        Note(
            "the command goes from {low:.4g} to {high:.4g} {unit}, even ramps up and down from {swept_low:.4g} to "
            "{swept_high:.4g} {unit}; the rest is left out",
            low=ends[0], high=ends[1], swept_low=swept[0], swept_high=swept[1], unit=unit,
        )
    ]  # fmt: skip


def _one_way(pairs: Sequence[Sequence[_Way]], unit: str) -> list[Note]:
    """Where at an end of the range the command only rises, or only falls."""
    ways = [one for group in pairs for one in group]
    low, high = _reach(ways)
    least, places, found = CRITERIA.side * (high - low), 3 - round(math.log10(high - low)), []
    for rises, alone in ((True, Note("falls")), (False, Note("rises"))):
        first, last = _reach(one for one in ways if (one[0] > 0.0) is rises)
        found += [(start, stop, alone) for start, stop in ((low, first), (last, high)) if stop - start > least]
    return [
        Note(
            "from {low:.4g} to {high:.4g} {unit} the command only {alone}; the loop's width there is taken from the "
            "rest. Record the other way too",
            low=round(start, places) + 0.0, high=round(stop, places) + 0.0, unit=unit, alone=alone,
        )
        for start, stop, alone in found
    ]  # fmt: skip


def _unpaired(groups: Sequence[Sequence[_Way]], unit: str) -> list[Note]:
    return [
        Note("at {speed:.3g} {unit}/s the command goes one way only: that is left out", speed=abs(one[0][0]), unit=unit)
        for one in groups
        if not _goes_both_ways(one)
    ]


def _at_ends(command: Array, response: Array) -> list[Standing]:
    """Waits at the lowest and the highest command."""
    return [
        Standing(level, value, std, count, risen)
        for level, risen in ((float(command.min()), False), (float(command.max()), True))
        for value, std, count in _waits(command, response, level)
    ]


def _waits(command: Array, response: Array, level: float) -> list[tuple[float, float, int]]:
    """(mean of the second half, its standard uncertainty, samples) of every wait at a level."""
    still = runs(np.abs(command - level) <= CRITERIA.stands * float(np.ptp(command)))
    return [
        (*settled(response[first:stop]), (stop - first + 1) // 2)
        for first, stop in still
        if stop - first >= CRITERIA.fewest_samples
    ]
