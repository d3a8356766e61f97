"""Stretches of a recording that is too long to be fitted whole: those in which the command tells most.

A stretch tells by how it moves the command: over levels, and from sample to sample at several rates. Each gives an
information matrix of such regressors; stretches are taken one after another, each time the one that adds most to the
determinant of the sum (D-optimal; Fedorov: Theory of Optimal Experiments, 1972).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.identification.experiment import Experiment
from hil.identification.mistaken.suspicion import can_be_held_against
from hil.identification.time_constant import time_constant_s
from hil.physics.model import Model
from hil.record.recording import Array, Recording

MOST_SAMPLES = 300_000
"""More are not fitted: what they would add to a fit is not worth their hours."""

_SAMPLES = 30_000  # of a stretch, or as many as these time constants take
_CONSTANTS = 40.0
_SETTLED_AFTER, _AT_MOST = 10.0, 0.5  # time constants (e^-10 is less than any noise), and a share of the stretch
_SETTLED_SHARE = 0.1  # of a stretch, where nobody knows a time constant
_LAGS = (1, 10, 100, 1000)


@dataclass(frozen=True, slots=True)
class Stretch:
    """So many samples from the first on."""

    first: int
    count: int


def experiments_of(
    model: Model,
    recordings: Sequence[Recording],
    command: Callable[[Recording], str],
    bind: Callable[[Recording], Experiment],
) -> tuple[list[Experiment], tuple[str, ...]]:
    """Recordings bound to a plant, in their most telling stretches where they are too long; and that in words.

    Args:
        model: the start of a fit, or what is diagnosed.
        recordings: all that are used together.
        command: the name of the channel that moves a recording.
        bind: makes a recording an experiment.
    """
    total = sum(len(one) for one in recordings)
    if total <= MOST_SAMPLES:
        return [bind(one) for one in recordings], ()
    made: list[Experiment] = []
    said = []
    for one in recordings:
        most = max(int(MOST_SAMPLES * len(one) / total), min(len(one), _SAMPLES))
        found = telling_stretches(one.values(command(one)), most, _length(model, one, bind, most))
        made += [_settling_left_out(model, bind(_named(one.rows(s.first, s.count)))) for s in found]
        said.append(_sentence(one, found))
    return made, tuple(said)


def telling_stretches(command: Array, most: int, length: int) -> list[Stretch]:
    """The stretches of a command, shape (n,), that tell most; no more samples than asked for, in order of time."""
    if len(command) <= most:
        return [Stretch(0, len(command))]
    low, high = float(np.nanmin(command)), float(np.nanmax(command))
    informations = [
        _information(command[first : first + length], low, high - low or 1.0)
        for first in range(0, len(command) - length + 1, length)
    ]
    total = 1e-6 * np.eye(len(informations[0]))
    left, chosen = dict(enumerate(informations)), []
    for _ in range(max(most // length, 1)):
        k = max(left, key=lambda i: float(np.linalg.slogdet(total + left[i])[1]))
        total += left.pop(k)
        chosen.append(k)
    return _joined(sorted(chosen), length)


def _information(values: Array, low: float, span: float) -> Array:
    """Sum of squares and products of what a stretch moves a plant by, per sample."""
    u = np.nan_to_num(2.0 * (values - low) / span - 1.0)
    moved = [np.concatenate((np.zeros(lag), u[lag:] - u[:-lag])) for lag in _LAGS if lag < len(u)]
    moved += [np.zeros(len(u))] * (len(_LAGS) - len(moved))
    seen = np.stack([np.ones(len(u)), u, u * u, u * u * u, *moved])
    found: Array = seen @ seen.T / len(u)
    return found


def _joined(chosen: Sequence[int], length: int) -> list[Stretch]:
    found: list[Stretch] = []
    for k in chosen:
        if found and found[-1].first + found[-1].count == k * length:
            found[-1] = replace(found[-1], count=found[-1].count + length)
        else:
            found.append(Stretch(k * length, length))
    return found


def _length(model: Model, recording: Recording, bind: Callable[[Recording], Experiment], most: int) -> int:
    beginning = recording.rows(0, min(len(recording), _SAMPLES))
    constant_s = time_constant_s(model, bind(beginning)) if can_be_held_against(model) else 0.0
    wanted = int(_CONSTANTS * constant_s / recording.interval_s)
    return int(np.clip(wanted, min(_SAMPLES, most), most))


def _settling_left_out(model: Model, e: Experiment) -> Experiment:
    """Where a stretch begins nobody knows what moves still."""
    constant_s = time_constant_s(model, e) if can_be_held_against(model) else 0.0
    settling_s = _SETTLED_AFTER * constant_s or _SETTLED_SHARE * e.duration_s
    until_s = e.time_s[0] + min(settling_s, _AT_MOST * e.duration_s)
    return e.without_all(e.time_s < until_s)


def _named(recording: Recording) -> Recording:
    start_s, stop_s = recording.time_s[0], recording.time_s[-1]
    return replace(recording, name=f"{recording.name}, {start_s:.6g}…{stop_s:.6g} s")


def _sentence(recording: Recording, found: Sequence[Stretch]) -> str:
    if [s.count for s in found] == [len(recording)]:
        return f"{recording.name}: used whole, {len(recording)} samples"
    used, seconds = sum(s.count for s in found), sum(s.count for s in found) * recording.interval_s
    stretches = "the stretch" if len(found) == 1 else f"the {len(found)} stretches"
    return (
        f"{recording.name}: {len(recording)} samples are more than a fit needs; {stretches} in which the command tells "
        f"most are used, {used} samples or {seconds:.4g} s in all, each without its start until it has settled"
    )
