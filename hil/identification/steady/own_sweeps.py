"""Slow sweeps in a recording that no procedure wrote: where the command rises and falls, and where it waits.

A sweep is a command that goes up and down over one range at an even speed. Between two turns it may stand still;
what the response is there, at an end, belongs to the curve as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hil.errors import InputError
from hil.identification.steady.criteria import CRITERIA
from hil.identification.steady.sweep_estimate import Standing, Sweep, settled
from hil.identification.uncertainty.fit import rms
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
    """

    sweeps: tuple[Sweep, ...]
    standing: tuple[Standing, ...]
    at_rest: tuple[float, float] | None


def own_sweeps(recordings: Sequence[Recording], input_name: str, output_name: str, neutral: float = 0.0) -> OwnSweeps:
    """The sweeps that recordings hold together.

    Raises:
        InputError: one holds no sweep, or only the way up or the way down.
    """
    ways: list[tuple[float, Array, Array]] = []
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
    if len({speed > 0.0 for speed, _, _ in ways}) < 2:
        done, lacking = ("rises", "falling") if ways[0][0] > 0.0 else ("falls", "rising")
        raise InputError(
            f"{recordings[0].name}: the command only {done}; the {lacking} sweep over the same range is missing: "
            "record it at the same speed and give both recordings"
        )
    return OwnSweeps(_by_speed(ways), tuple(standing), rests[0] if rests else None)


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
    begin, end = np.searchsorted(time_s, ends_s + np.array([-1e-9, 1e-9]) * np.ptp(ends_s))
    return Branch(max(int(begin), first), min(int(end), last + 1), float(slope))


def _line(time_s: Array, command: Array, branch: Branch) -> Array:
    """The command of a branch as the line that it follows: noise of a measured command turns no sample back."""
    late = time_s[branch.samples] - time_s[branch.first]
    slope, level = np.polyfit(late, command[branch.samples], 1)
    return level + slope * late


def _by_speed(ways: Sequence[tuple[float, Array, Array]]) -> tuple[Sweep, ...]:
    """Branches of one speed together, whichever way they go."""
    groups: list[list[tuple[float, Array, Array]]] = []
    for way in sorted(ways, key=lambda one: -abs(one[0])):
        if groups and abs(way[0]) >= (1.0 - CRITERIA.same_speed) * abs(groups[-1][0][0]):
            groups[-1].append(way)
        else:
            groups.append([way])
    return tuple(
        Sweep(
            np.concatenate([command for _, command, _ in group]), np.concatenate([answer for _, _, answer in group]),
            float(np.mean([abs(speed) for speed, _, _ in group])),
        )
        for group in groups
    )  # fmt: skip


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
