"""Stretches of a recording that is too long to be fitted whole: those in which the command tells most.

A stretch tells by how it moves the command: over levels, and from sample to sample at several rates. Each gives an
information matrix of such regressors; stretches are taken one after another, each time the one that adds most to the
determinant of the sum (D-optimal; Fedorov: Theory of Optimal Experiments, 1972).

Where a stretch begins nobody knows what moves still. What comes to rest with the output is left out until it has, and
so is an inner signal that comes to rest more slowly (the warmth of a coil), by the model of the whole recording.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hil.identification.preparation.criteria import CRITERIA, EFFORT
from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.plausibility.suspicion import can_be_held_against
from hil.identification.preparation.time_constant import time_constant_s
from hil.identification.uncertainty.noise import channel_floor
from hil.language.note import Note
from hil.physics.model import Model
from hil.record.recording import Array, Recording
from hil.signals.runs import runs

_FELT = 1.0  # of χ²: what the rest of a stretch may differ by, so that it moves no parameter by its uncertainty


def experiments_of(
    model: Model,
    recordings: Sequence[Recording],
    command: Callable[[Recording], str],
    bind: Callable[[Recording], Experiment],
    computing_s: float = math.inf,
) -> tuple[list[Experiment], tuple[Note, ...]]:
    """Recordings bound to a plant, in their most telling stretches where they are too long; and that in words.

    Args:
        model: the start of a fit, or what is diagnosed.
        recordings: all that are used together.
        command: the name of the channel that moves a recording.
        bind: makes a recording an experiment.
        computing_s: budget of a diagnosis: too long is what would take more.
    """
    total, most = sum(len(one) for one in recordings), EFFORT.most_samples
    if math.isfinite(computing_s) and total > EFFORT.fewest_samples:
        affordable = computing_s * EFFORT.samples_per_s / EFFORT.answers  # by the simulations that diagnoses take
        most = int(np.clip(affordable, EFFORT.fewest_samples, EFFORT.most_samples))
    if total <= most:
        return [bind(one) for one in recordings], ()
    made: list[Experiment] = []
    notes = []
    for one in recordings:
        own = max(int(most * len(one) / total), min(len(one), EFFORT.segment_samples, most))
        found = informative_segments(one.values(command(one)), own, _length(model, one, bind, own))
        notes.append(_sentence(one, found))
        cut = []
        for first, stop in found:
            start_s, stop_s = one.time_s[first], one.time_s[stop - 1]
            e = bind(replace(one.rows(first, stop - first), name=f"{one.name}, {start_s:.6g}…{stop_s:.6g} s"))
            # where a stretch begins nobody knows what moves still
            constant_s = time_constant_s(model, e) if can_be_held_against(model) else 0.0
            settling_s = CRITERIA.forgotten_after * constant_s or CRITERIA.settling_share * e.duration_s
            until_s = e.time_s[0] + min(settling_s, CRITERIA.unsettled_share * e.duration_s)
            cut.append(e.without_all(e.time_s < until_s))
        if any(e.observed for e in cut):
            whole = bind(one)
            rows = whole.simulated(model)
            cut = [_as_in_the_whole(model, e, rows[:, np.searchsorted(whole.time_s, e.time_s)]) for e in cut]
        made += cut
    return made, tuple(notes)


def _as_in_the_whole(model: Model, e: Experiment, rows: Array) -> Experiment:
    """A stretch without inner signals for as long as the model is not yet in them what it is there in the whole.

    Args:
        model: as it is before anything is fitted.
        e: the stretch.
        rows: the model's answer there to the whole recording, shape (1 + observed, n).
    """
    begun, found = e.simulated(model), e
    for signal, known, unknown in zip(model.definition.observed, rows[1:], begun[1:], strict=True):
        if signal.name not in e.observed or not (floor := channel_floor(e.observed[signal.name])):
            continue
        felt = np.where(e.valid_in(signal.name), (known - unknown) / floor, 0.0) ** 2
        moving = np.cumsum(felt[::-1])[::-1] > _FELT
        informs = (e.valid_in(signal.name) & ~moving).any()
        found = found.without(moving, signal.name) if informs else _without_signal(found, signal.name)
    return found


def _without_signal(e: Experiment, name: str) -> Experiment:
    observed = {other: values for other, values in e.observed.items() if other != name}
    return replace(e, observed=observed, invalid={n: samples for n, samples in e.invalid.items() if n != name})


def informative_segments(command: Array, most: int, length: int) -> list[tuple[int, int]]:
    """(first, one past the last) sample of the stretches of a command, shape (n,), that tell most, in order of time.

    No more samples than asked for.
    """
    if len(command) <= most:
        return [(0, len(command))]
    low, high = float(np.nanmin(command)), float(np.nanmax(command))
    informations = [
        _information(command[first : first + length], low, high - low or 1.0)
        for first in range(0, len(command) - length + 1, length)
    ]
    total = 1e-6 * np.eye(len(informations[0]))
    left, chosen = dict(enumerate(informations)), np.zeros(len(informations), dtype=np.bool_)
    for _ in range(max(most // length, 1)):
        k = max(left, key=lambda i: float(np.linalg.slogdet(total + left[i])[1]))
        total += left.pop(k)
        chosen[k] = True
    return [(first * length, stop * length) for first, stop in runs(chosen)]


def _information(values: Array, low: float, span: float) -> Array:
    """Sum of squares and products of what a stretch moves a plant by, per sample."""
    u = np.nan_to_num(2.0 * (values - low) / span - 1.0)
    moved = [np.concatenate((np.zeros(lag), u[lag:] - u[:-lag])) for lag in EFFORT.lags if lag < len(u)]
    moved += [np.zeros(len(u))] * (len(EFFORT.lags) - len(moved))
    seen = np.stack([np.ones(len(u)), u, u * u, u * u * u, *moved])
    return seen @ seen.T / len(u)


def _length(model: Model, recording: Recording, bind: Callable[[Recording], Experiment], most: int) -> int:
    beginning = recording.rows(0, min(len(recording), EFFORT.segment_samples))
    constant_s = time_constant_s(model, bind(beginning)) if can_be_held_against(model) else 0.0
    if not constant_s:
        return min(EFFORT.segment_samples, most)
    wanted = int(EFFORT.segment_constants * constant_s / recording.interval_s)
    longest = max(
        most // EFFORT.timed_segments, wanted // 2, 1
    )  # half of that is enough where few samples are asked for
    return min(int(np.clip(wanted, min(EFFORT.segment_samples, most // EFFORT.segments), longest)), most)


def _sentence(recording: Recording, found: Sequence[tuple[int, int]]) -> Note:
    samples, used = len(recording), sum(stop - first for first, stop in found)
    if used == samples:
        return Note("used whole, {samples} samples", samples=samples).of(recording.name)
    return Note(
        "{samples} samples are more than a fit needs; {used} ({used_s:.4g} s) in informative segments ({count}) are "
        "used, each from where it has settled",
        samples=samples, used=used, used_s=used * recording.interval_s, count=len(found),
    ).of(recording.name)  # fmt: skip
