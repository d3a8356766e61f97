"""Stretches of a recording that is too long to be fitted whole: those in which the command tells most.

A stretch tells by how it moves the command: over levels, and from sample to sample at several rates. Each gives an
information matrix of such regressors; stretches are taken one after another, each time the one that adds most to the
determinant of the sum (D-optimal; Fedorov: Theory of Optimal Experiments, 1972).

Where a stretch begins nobody knows what moves still. What comes to rest with the output is left out until it has. What
comes to rest more slowly and shows in an inner signal (the warmth of a coil) is as in the model of the whole recording:
the stretch begins at rest at the level that brings the model there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.plausibility.suspicion import can_be_held_against
from hil.identification.preparation.time_constant import time_constant_s
from hil.identification.uncertainty.noise import channel_floor
from hil.language.note import Note
from hil.physics.model import Model
from hil.record.recording import Array, Recording
from hil.signals.runs import runs

MOST_SAMPLES = 300_000
"""More are not fitted: what they would add to a fit is not worth their hours."""

_SAMPLES = 30_000  # of a stretch, or as many as these time constants take
_CONSTANTS = 40.0
_SEVERAL, _FEW = 8, 4  # stretches that are taken where nobody knows a time constant, and where one is known
_SETTLED_AFTER, _AT_MOST = 10.0, 0.5  # time constants (e^-10 is less than any noise), and a share of the stretch
_ANSWERS = 10_000  # of the model, that a diagnosis takes at most: 3000 to 10 000 where they were counted
_FEWEST_SAMPLES = 12_000  # less time than these take is not asked for: a diagnosis of fewer tells little
_SAMPLES_PER_S = 10e6  # simulated samples that a second of a budget stands for
_SETTLED_SHARE = 0.1  # of a stretch, where nobody knows a time constant
_LAGS = (1, 10, 100, 1000)
_BEYOND = 0.1  # of the commands' span, in which a level to begin at is looked for too
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
    total, most = sum(len(one) for one in recordings), MOST_SAMPLES
    if math.isfinite(computing_s) and total > _FEWEST_SAMPLES:
        affordable = computing_s * _SAMPLES_PER_S / _ANSWERS  # by the simulations that diagnoses take
        most = int(np.clip(affordable, _FEWEST_SAMPLES, MOST_SAMPLES))
    if total <= most:
        return [bind(one) for one in recordings], ()
    made: list[Experiment] = []
    notes = []
    for one in recordings:
        own = max(int(most * len(one) / total), min(len(one), _SAMPLES, most))
        found = informative_segments(one.values(command(one)), own, _length(model, one, bind, own))
        made += _bound(model, one, found, bind)
        notes.append(_sentence(one, found))
    return made, tuple(notes)


def _bound(
    model: Model, one: Recording, found: Sequence[tuple[int, int]], bind: Callable[[Recording], Experiment]
) -> list[Experiment]:
    cut = [_settling_left_out(model, bind(_named(one.rows(first, stop - first)))) for first, stop in found]
    if not any(e.observed for e in cut):
        return cut
    whole = bind(one)
    rows = whole.simulated(model)
    command = whole.drive.inputs[0]
    beyond = _BEYOND * float(np.ptp(command))
    reach = float(command.min()) - beyond, float(command.max()) + beyond
    return [_begun_as(model, e, rows[:, np.searchsorted(whole.time_s, e.time_s)], reach) for e in cut]


def _begun_as(model: Model, e: Experiment, rows: Array, reach: tuple[float, float]) -> Experiment:
    """A stretch that begins at rest at the level from which the model comes nearest to what it is there in the whole.

    What is still not as in the whole is left out of inner signals, until it is.

    Args:
        model: as it is before anything is fitted.
        e: the stretch.
        rows: the model's answer there to the whole recording, shape (1 + observed, n).
        reach: between which levels it may begin.
    """
    found = _from_level(model, e, rows, reach)
    apart = _apart(model, found, rows)
    for name, felt in apart.items():
        moving = np.cumsum(felt[::-1])[::-1] > _FELT
        informs = (found.valid_in(name) & ~moving).any()
        found = found.without(moving, name) if informs else _without_signal(found, name)
    return found


def _from_level(model: Model, e: Experiment, rows: Array, reach: tuple[float, float]) -> Experiment:
    """Begun at rest at another level, where that is nearer to the whole."""
    if sum(float(felt.sum()) for felt in _apart(model, e, rows).values()) <= _FELT:
        return e

    def apart(level: float) -> float:
        return sum(float(felt.sum()) for felt in _apart(model, _resting_at(e, level), rows).values())

    from scipy.optimize import minimize_scalar

    best = minimize_scalar(apart, bounds=reach, method="bounded")
    nearer = _resting_at(e, float(best.x))
    return nearer if best.fun < apart(float(e.drive.inputs[0, 0])) else e


def _resting_at(e: Experiment, level: float) -> Experiment:
    inputs = e.drive.inputs.copy()
    inputs[0, 0] = level
    return e.driven(inputs)


def _apart(model: Model, e: Experiment, rows: Array) -> dict[str, Array]:
    """What the model begun at the stretch differs by from the model of the whole, in χ² of each sample of a signal."""
    begun = e.simulated(model)
    found = {}
    for signal, known, unknown in zip(model.definition.observed, rows[1:], begun[1:], strict=True):
        if signal.name in e.observed and (floor := channel_floor(e.observed[signal.name])):
            found[signal.name] = np.where(e.valid_in(signal.name), (known - unknown) / floor, 0.0) ** 2
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
    moved = [np.concatenate((np.zeros(lag), u[lag:] - u[:-lag])) for lag in _LAGS if lag < len(u)]
    moved += [np.zeros(len(u))] * (len(_LAGS) - len(moved))
    seen = np.stack([np.ones(len(u)), u, u * u, u * u * u, *moved])
    return seen @ seen.T / len(u)


def _length(model: Model, recording: Recording, bind: Callable[[Recording], Experiment], most: int) -> int:
    beginning = recording.rows(0, min(len(recording), _SAMPLES))
    constant_s = time_constant_s(model, bind(beginning)) if can_be_held_against(model) else 0.0
    if not constant_s:
        return min(_SAMPLES, most)
    wanted = int(_CONSTANTS * constant_s / recording.interval_s)
    longest = max(most // _FEW, wanted // 2, 1)  # half of that is enough where few samples are asked for
    return min(int(np.clip(wanted, min(_SAMPLES, most // _SEVERAL), longest)), most)


def _settling_left_out(model: Model, e: Experiment) -> Experiment:
    """Where a stretch begins nobody knows what moves still."""
    constant_s = time_constant_s(model, e) if can_be_held_against(model) else 0.0
    settling_s = _SETTLED_AFTER * constant_s or _SETTLED_SHARE * e.duration_s
    until_s = e.time_s[0] + min(settling_s, _AT_MOST * e.duration_s)
    return e.without_all(e.time_s < until_s)


def _named(recording: Recording) -> Recording:
    start_s, stop_s = recording.time_s[0], recording.time_s[-1]
    return replace(recording, name=f"{recording.name}, {start_s:.6g}…{stop_s:.6g} s")


def _sentence(recording: Recording, found: Sequence[tuple[int, int]]) -> Note:
    samples, used = len(recording), sum(stop - first for first, stop in found)
    if used == samples:
        return Note("used whole, {samples} samples", samples=samples).of(recording.name)
    return Note(
        "{samples} samples are more than a fit needs; {used} ({used_s:.4g} s) in informative segments ({count}) are "
        "used, each from where it has settled",
        samples=samples, used=used, used_s=used * recording.interval_s, count=len(found),
    ).of(recording.name)  # fmt: skip
