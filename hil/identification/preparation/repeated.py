"""Samples that were not measured anew: the recording repeats its last value."""

from __future__ import annotations

import numpy as np

from hil.identification.preparation.criteria import CRITERIA
from hil.identification.preparation.experiment import Experiment
from hil.identification.uncertainty.noise import NOISE_OVER_RESOLUTION, resolution, white_floor
from hil.language.note import Note
from hil.record.recording import Array
from hil.signals.runs import runs

Run = tuple[int, int]

# A noisy channel shows the same value so often in a row only when nobody has measured it anew: chance would make
# such a run in one of so many recordings.
STALE_RUN = 4
LEAST_INTERVALS = 3  # fewer may be anything


def without_stale(e: Experiment) -> tuple[Experiment, list[Run]]:
    """The experiment with samples ignored that only repeat the one before, and those runs, first and after last.

    Samples that are ignored already are not looked at.
    """
    there = np.flatnonzero(e.valid)
    every = [(int(there[first]), int(there[last - 1]) + 1) for first, last in _stale_runs(e.valid_output)]
    repeated = [(start, stop) for start, stop in every if start > 0 or stop > _first_move(e)]
    if len(repeated) < LEAST_INTERVALS and not any(_is_long(e, start, stop) for start, stop in repeated):
        return e, []
    stale = np.zeros(len(e.output), dtype=np.bool_)
    for start, stop in repeated:
        stale[start + 1 : stop] = True
    return e.without(stale), repeated


def stale_sentence(e: Experiment, repeated: list[Run]) -> Note:
    """The same in words."""
    lasting_s = float(np.mean([e.time_s[stop - 1] - e.time_s[start] for start, stop in repeated]))
    return Note(
        "channel '{channel}' was not measured anew {times} ×, for {lasting_s:.2g} s on average; repeats are left out",
        channel=e.output_heading, times=len(repeated), lasting_s=lasting_s,
    ).of(e.name)  # fmt: skip


def without_held(e: Experiment) -> tuple[Experiment, list[Note]]:
    """The experiment without samples that only repeat one of a slower channel, and that in words."""
    starts = np.flatnonzero(np.diff(e.output, prepend=np.nan) != 0.0)
    lengths = np.diff(starts)
    if len(lengths) < CRITERIA.fewest_runs:
        return e, []
    usual = int(np.median(lengths))
    fresh = e.output[starts]
    noisy = white_floor(fresh) >= NOISE_OVER_RESOLUTION * resolution(fresh) > 0.0
    if usual < 2 or not noisy or np.mean(lengths == usual) < CRITERIA.same_run:
        return e, []
    repeated = np.ones(len(e.output), dtype=np.bool_)
    repeated[starts] = False
    note = Note(
        "channel '{channel}' shows each value {usual} times: it was sampled every {every_s:.4g} s and held in between; "
        "the repeats are left out",
        channel=e.output_heading, usual=usual, every_s=usual * e.interval_s,
    )  # fmt: skip
    return e.without(repeated), [note.of(e.name)]


def longer_than_by_chance(steps: Array, floor: float) -> int:
    """So many identical values in a row are more than chance makes anywhere in a recording."""
    longest = 1.0 + np.log(CRITERIA.chance_runs / (len(steps) + 1)) / np.log(same_again(steps, floor))
    return max(STALE_RUN, int(np.ceil(longest)))


def same_again(steps: Array, floor: float) -> float:
    """The probability that two readings of white noise agree within the resolution."""
    moving = steps[steps > 0.0]
    return float(moving.min()) / (2.0 * np.sqrt(np.pi) * floor) if moving.size and floor > 0.0 else 1.0


def _first_move(e: Experiment) -> int:
    """The sample at which an input moves first: a recording may begin with one value of a unit that rests."""
    moved = np.any(np.diff(e.drive.inputs) != 0.0, axis=0)
    return int(np.argmax(moved)) + 1 if e.grid_s is None and moved.any() else 0


def _is_long(e: Experiment, start: int, stop: int) -> bool:
    return bool(stop - start >= CRITERIA.lone_samples and e.time_s[stop - 1] - e.time_s[start] >= CRITERIA.lone_s)


def _stale_runs(values: Array) -> list[Run]:
    """Runs of identical values in a channel whose noise, where it was measured, is well above its resolution."""
    steps = np.abs(np.diff(values))
    moving = steps[steps > 0.0]
    repeats = runs(steps == 0.0)
    lasting = np.zeros(len(values), dtype=np.bool_)
    for start, stop in repeats:
        lasting[start + 1 : stop + 1] = stop - start >= CRITERIA.lone_samples
    floor = white_floor(values[~lasting])
    if not moving.size or floor < NOISE_OVER_RESOLUTION * float(moving.min()):
        return []
    least = longer_than_by_chance(steps, floor)
    ends = np.array([values.max(), values.min()])
    return [
        (start, stop + 1)
        for start, stop in repeats
        if stop - start >= least - 1 and values[start] not in ends and not _by_itself(values, start, stop)
    ]


def _by_itself(values: Array, start: int, stop: int) -> bool:
    """Whether chance may make a run, the values beside it being what they are."""
    beside = np.concatenate(
        [values[max(start - CRITERIA.adjacent, 0) : start], values[stop + 1 : stop + 1 + CRITERIA.adjacent]]
    )
    chance = float(np.mean(beside == values[start])) if beside.size else 0.0
    return bool(len(values) * chance ** (stop - start) > CRITERIA.chance_runs)
