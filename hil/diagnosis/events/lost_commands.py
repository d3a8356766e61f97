"""Commands that did not arrive: stretches in which the command stood still on its way."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hil.cores import parallel_map
from hil.diagnosis.events.bursts import BLOCK_S, Burst, all_bursts, is_sparse
from hil.diagnosis.events.event import Events, Interval, how_often
from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.search.fitted import Fitted, residuals_of
from hil.diagnosis.thresholds import A_GOOD_PART, TINY
from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.repeated import LEAST_INTERVALS
from hil.language.note import Note
from hil.record.recording import Array, Integers

# A jump is this share of the command's range; what comes with so many of them, and hardly without, has a law.
_JUMP, _NEARLY_ALL = 0.1, 0.75
_LOOK_BACK_S = 0.4
_BACK_S = 0.024
_LASTING_S = np.geomspace(0.03, 1.4, 13)

Holds = list[list[Burst]]
Bursts = Sequence[Sequence[Burst]]


def held_commands(problem: Problem, model: Fitted) -> Events | None:
    """Stretches in which the command stood still on its way; None when the misfit does not come in bursts.

    Every burst gets its own start and length; one simulation tries one offset and length at all bursts at once.
    """
    bursts = all_bursts(problem, model)
    count = sum(map(len, bursts))
    if count < LEAST_INTERVALS or not is_sparse(problem, model.residuals, bursts):
        return None
    holds = _best_holds(problem, model, bursts)
    if holds is None:
        return None
    rest = _held(problem, holds)
    intervals = tuple(
        Interval(
            e.name, float(e.time_s[0] + start * e.drive.interval_s), float(e.time_s[0] + stop * e.drive.interval_s)
        )
        for e, own in zip(problem.experiments, holds, strict=True)
        for start, stop in own
        if stop > start
    )
    if len(intervals) < LEAST_INTERVALS:
        return None
    values = how_often(intervals)
    first = problem.plant.hooks[0]
    return Events(
        "dropout", first.stage, first.name, intervals, values, residuals_of(problem, model, experiments=rest), rest,
        Note("The command did not always arrive: {times} times the valve stood on the last one, {lasting_s:.2g} s on "
             "average.", times=len(intervals), lasting_s=values["lasting"][0]),
        "u(t) = u(t_k) for t_k ≤ t < t_k + d_k, at random t_k",
    )  # fmt: skip


def comes_every_time(problem: Problem, model: Fitted) -> bool:
    """Whether the misfit comes with nearly every jump of the command that is large enough to show it, and hardly ever
    without one: then it has a law. What gets lost at random moments misses most jumps.
    """
    bursts = all_bursts(problem, model)
    sizes, shown, beside = [], [], 0
    for e, own in zip(problem.experiments, bursts, strict=True):
        at, size = _jumps(e)
        back = round(_LOOK_BACK_S / e.drive.interval_s)
        felt = np.array([(start - back, stop) for start, stop in own], dtype=np.int64).reshape(-1, 2)
        jump_in_burst = (at[:, None] >= felt[None, :, 0]) & (at[:, None] < felt[None, :, 1])
        sizes.append(size)
        shown.append(jump_in_burst.any(axis=1))
        beside += int((~jump_in_burst.any(axis=0)).sum())
    size, hit = np.concatenate(sizes), np.concatenate(shown)
    if hit.sum() < LEAST_INTERVALS or beside > (1.0 - _NEARLY_ALL) * sum(map(len, bursts)):
        return False
    return float(hit[size >= np.median(size[hit])].mean()) > _NEARLY_ALL


def _jumps(e: Experiment) -> tuple[Integers, Array]:
    """Where the command jumps, by a good share of its range between two samples, and by how much."""
    steps = np.abs(np.diff(e.drive.inputs[0]))
    at = np.flatnonzero(steps > _JUMP * max(float(np.ptp(e.drive.inputs[0])), TINY))
    return at, steps[at]


def _best_holds(problem: Problem, model: Fitted, bursts: Bursts) -> Holds | None:
    """For every burst the held stretch that explains most of it: a coarse look, then finer ones around the best.

    None where the first look, at every other burst, takes no good part of the misfit there.
    """
    chosen: Holds = [[(start, start) for start, _ in own] for own in bursts]
    step = [e.drive.interval_s for e in problem.experiments]
    windows = [
        [(max(start - round(_LOOK_BACK_S / dt), 0), stop + round(_LOOK_BACK_S / dt)) for start, stop in own]
        for own, dt in zip(bursts, step, strict=True)
    ]

    def costs(holds: Holds) -> list[list[float]]:
        return _costs(problem, residuals_of(problem, model, experiments=_held(problem, holds)), windows)

    best = costs(chosen)

    def keep_better(trials: Sequence[Holds], parity: int) -> None:
        """Try holds at every other burst, the ones between staying as they are: neighbours are felt in each other."""
        nonlocal best
        mixed = [_mixed(chosen, trial, parity) for trial in trials]
        before = [list(own) for own in chosen]
        for trial, tried in zip(mixed, parallel_map(costs, mixed), strict=True):
            for k, own in enumerate(tried):
                for i in range(parity, len(own), 2):
                    if own[i] < best[k][i] - 2.0 * np.log(problem.size):
                        best[k][i], chosen[k][i] = own[i], trial[k][i]
        if chosen != before:
            best = costs(chosen)

    coarse_look = [
        _placed(bursts, step, back, lasting)
        for back in np.arange(-BLOCK_S, _LOOK_BACK_S, _BACK_S)
        for lasting in _LASTING_S
    ]
    nothing_held = _of_every_other(best, bursts)
    keep_better(coarse_look, 0)
    if _of_every_other(best, bursts) > (1.0 - A_GOOD_PART) * nothing_held:
        return None
    keep_better(coarse_look, 1)
    for fine_s in (_BACK_S / 2.0, _BACK_S / 4.0, _BACK_S / 8.0):
        for moves in ((-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, 1)) * 2:
            for parity in (0, 1):
                keep_better([_moved(chosen, bursts, step, fine_s, moves)], parity)
    return chosen


def _of_every_other(costs: Sequence[Sequence[float]], bursts: Bursts) -> float:
    """Squared residuals at the bursts that the first look is made at, beyond what noise would make of their time."""
    noise = sum(stop - start for own in bursts for start, stop in own[::2])
    return sum(cost for own in costs for cost in own[::2]) - noise


def _mixed(holds: Holds, trial: Holds, parity: int) -> Holds:
    """Every other hold taken from the trial."""
    return [
        [tried if i % 2 == parity else held for i, (held, tried) in enumerate(zip(own, other, strict=True))]
        for own, other in zip(holds, trial, strict=True)
    ]


def _placed(bursts: Bursts, step: Sequence[float], back_s: float, for_s: float) -> Holds:
    """A hold for every burst, so long before it; none lasts longer than the burst."""
    found = []
    for own, dt in zip(bursts, step, strict=True):
        starts = [max(start - round(back_s / dt), 1) for start, _ in own]
        found.append([(a, min(a + round(for_s / dt), stop)) for a, (_, stop) in zip(starts, own, strict=True)])
    return found


def _moved(holds: Holds, bursts: Bursts, step: Sequence[float], by_s: float, moves: tuple[int, int]) -> Holds:
    """The holds with their start, end or both moved by so much, either way."""
    found = []
    for own, felt, dt in zip(holds, bursts, step, strict=True):
        by = max(1, round(by_s / dt))
        found.append(
            [
                (max(a + moves[0] * by, 1), min(z + moves[1] * by, stop)) if z > a else (a, z)
                for (a, z), (_, stop) in zip(own, felt, strict=True)
            ]
        )
    return found


def _costs(problem: Problem, residuals: Array, windows: Bursts) -> list[list[float]]:
    """Squared residuals in each window."""
    parts = problem.outputs_of(residuals)
    return [[float(r[a:z] @ r[a:z]) for a, z in own] for r, own in zip(parts, windows, strict=True)]


def _held(problem: Problem, holds: Holds) -> tuple[Experiment, ...]:
    """The experiments with what arrived of their commands."""
    experiments = []
    for e, own in zip(problem.experiments, holds, strict=True):
        inputs = e.drive.inputs.copy()
        for start, stop in own:
            if start < stop:  # one that would begin after its burst holds nothing
                inputs[0, start:stop] = inputs[0, start - 1]
        experiments.append(e.driven(inputs))
    return tuple(experiments)
