"""Samples that were not measured anew: the recording repeats its last value."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hil.diagnosis.events.bursts import Burst, bursts_of
from hil.diagnosis.events.event import Events, Interval, how_often
from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.search.fitted import Fitted, output_of, residuals_of
from hil.diagnosis.thresholds import A_GOOD_PART, CERTAIN, MOST
from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.repeated import LEAST_INTERVALS, STALE_RUN, longer_than_by_chance, same_again
from hil.identification.preparation.repeated import without_stale as repeats_left_out
from hil.identification.uncertainty.noise import white_floor
from hil.language.note import Note
from hil.record.recording import Array
from hil.signals.runs import runs

# In bursts of misfit a run is telling already when chance makes so few of them there.
_CHANCE_IN_BURSTS = 0.3
# A channel with less noise repeats its readings by itself wherever the unit is slow.
_REPEATS_BY_ITSELF = 0.6


def without_stale(experiments: Sequence[Experiment]) -> tuple[tuple[Experiment, ...], tuple[Interval, ...]]:
    """The experiments with samples ignored that only repeat the one before, and where those are."""
    kept, intervals = [], []
    for e in experiments:
        fresh, repeated = repeats_left_out(e)
        kept.append(fresh)
        intervals += [Interval(e.name, float(e.time_s[start]), float(e.time_s[stop - 1])) for start, stop in repeated]
    return tuple(kept), tuple(intervals)


def held_outputs(problem: Problem, model: Fitted) -> Events | None:
    """Samples that repeat the one before where a coarse channel would not: in bursts of misfit more often than by
    chance, or while the model goes on and the output catches up with it in the end.

    Where noise is hardly above the resolution `without_stale` needs longer runs than a short loss makes.
    """
    rest, intervals = [], []
    for k, e in enumerate(problem.experiments):
        stale = np.zeros(len(e.output), dtype=np.bool_)
        in_bursts = _repeats_in_bursts(e.output, bursts_of(problem, model.residuals, k))
        for start, stop in in_bursts or _caught_up(problem, model, e):
            stale[start + 1 : stop] = True
            intervals.append(Interval(e.name, float(e.time_s[start]), float(e.time_s[stop - 1])))
        rest.append(e.without(stale))
    if len(intervals) < LEAST_INTERVALS:
        return None
    residuals = residuals_of(problem, model, experiments=rest)
    return stale_outputs(intervals, problem, residuals + misfit_while_stale(problem, rest, residuals), tuple(rest))


def misfit_while_stale(problem: Problem, rest: Sequence[Experiment], residuals: Array) -> Array:
    """What counts of samples that were not measured anew: the misfit of the last one that was, shape (n,).

    It did not come with the loss: a model that is off at a constant output is as far off beside readings that repeat.
    """
    found = np.zeros(len(residuals))
    outputs = zip(problem.experiments, rest, problem.outputs_of(residuals), problem.outputs_of(found), strict=True)
    for before, now, own, carried in outputs:
        last = np.maximum.accumulate(np.where(now.valid, np.arange(len(own)), 0))
        is_lost = before.valid & ~now.valid
        carried[is_lost] = own[last[is_lost]]
    return found


def stale_outputs(
    intervals: Sequence[Interval], problem: Problem, residuals: Array, rest: tuple[Experiment, ...]
) -> Events:
    """The finding for samples that were not measured anew and are left out of the rest."""
    values = how_often(intervals)
    last = problem.plant.hooks[-1]
    return Events(
        "dropout", last.stage, last.name, tuple(intervals), values, residuals, rest,
        Note("Samples were not measured anew: {times} × the recording repeats its last value, {lasting_s:.2g} s on "
             "average.", times=len(intervals), lasting_s=values["lasting"][0]),
        "y(t) = y(t_k) for t_k ≤ t < t_k + d_k, at random t_k",
    )  # fmt: skip


def _repeats_in_bursts(values: Array, bursts: Sequence[Burst]) -> list[tuple[int, int]]:
    """Runs of identical values in these stretches, so long that chance makes hardly one of them."""
    steps = np.abs(np.diff(values))
    looked_at = sum(stop - start for start, stop in bursts)
    chance = same_again(steps, white_floor(values))
    if not looked_at or chance > A_GOOD_PART:
        return []
    least = max(STALE_RUN - 1, 1 + int(np.ceil(np.log(_CHANCE_IN_BURSTS / looked_at) / np.log(chance))))
    inside = np.zeros(len(steps), dtype=np.bool_)
    for start, stop in bursts:
        inside[max(start - 1, 0) : stop] = True
    return [(start, stop + 1) for start, stop in runs((steps == 0.0) & inside) if stop + 1 - start >= least]


def _caught_up(problem: Problem, model: Fitted, e: Experiment) -> list[tuple[int, int]]:
    """Runs of identical values after which the output catches up at once with most of the way, beyond doubt in steps or
    noise deviations, that the model went meanwhile: what sticks comes loose, but not within a sample.
    """
    values, steps, floor = e.output, np.abs(np.diff(e.output)), white_floor(e.output)
    if same_again(steps, floor) > _REPEATS_BY_ITSELF:
        return []
    least = CERTAIN * max(float(steps[steps > 0.0].min()), floor)
    shortest = longer_than_by_chance(steps, floor)
    simulated = output_of(problem, model, e)
    found = []
    for start, last in runs(steps == 0.0):
        if last - start + 1 < shortest or last + 1 == len(values):
            continue
        jump, went = values[last + 1] - values[last], simulated[last + 1] - simulated[start]
        goes = abs(simulated[last + 1] - simulated[last])
        if abs(went) >= least and max(abs(jump - went), goes) <= MOST * abs(went):
            found.append((start, last + 1))
    return found
