"""Stamps in another unit than their heading says: they make a unit look slow or quick, and no channel shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.errors import option
from hil.identification.preparation.criteria import CRITERIA
from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.plausibility.suspicion import (
    Suspicion,
    expected,
    good_fit,
    moves,
    spoken_of,
)
from hil.identification.preparation.time_constant import time_constant_s
from hil.language.note import Note
from hil.physics.model import Model

# Minutes and milliseconds: no unit of time is ten times another. Stamps are exact where the unit is all that is wrong.
_TIME_FACTORS = (1000.0, 60.0, 1 / 60.0, 0.001)


def wrong_time(model: Model, experiments: Sequence[Experiment]) -> list[Suspicion]:
    """Recordings whose time is off by the factor of a wrong unit.

    None of a bench that timed its samples. Suspected only where the samples are as many times as far apart as a wrong
    unit makes them; recordings at a tenth of the rate are common, so that the model has to fit much better besides. A
    model that knows no intervals, being no unit's, has to fit well with another time and hardly at all with this one.
    """
    experiments = [e for e in experiments if not e.is_timed and "time" not in e.stated_units]
    known = [float(interval_s) for interval_s in model.origin.get("intervals_s") or ()]
    if not known:
        return [one for e in experiments if (one := _fits_in_another_time(model, e))]
    suspected: dict[float, list[Experiment]] = {}
    for e in experiments:
        if (factor := _time_factor(e.interval_s, known)) is not None:
            suspected.setdefault(factor, []).append(e)
    found = []
    for factor, group in suspected.items():
        fits = [(_fit(model, e), _fit(model, _quicker(e, factor))) for e in group]
        votes = [_vote(*of_both) for of_both in fits]
        if votes.count(1) > votes.count(-1):
            first = votes.index(1)
            found.append(_beside_others(group[first], factor, fits[first][1]))
    return found


def _beside_others(e: Experiment, factor: float, fit: float) -> Suspicion:
    apart = Note(
        "its samples are {factor:.4g} times as far apart as those of identification. The model fits only with the time "
        "divided by {factor:.4g}; it looks like a wrong unit of time. If it is right, identify the model on a "
        "recording of this interval too",
        factor=factor,
    )
    return Suspicion(e.name, apart.of(e.name), fit)


def _fits_in_another_time(model: Model, e: Experiment) -> Suspicion | None:
    """Where a typical unit fits much better, and well, with the time of another unit."""
    if model.definition.observer is not None:  # led back along another time it fits anything
        return None
    constant_s = time_constant_s(model, e)
    shown = [f for f in _TIME_FACTORS if e.interval_s / f < constant_s < e.duration_s / f]
    recorded = _fit(model, e)
    tried = [(fit, f) for f in shown if np.isfinite(fit := _fit(model, _quicker(e, f)))]
    fit, factor = max(tried, default=(-np.inf, 1.0))
    if fit < good_fit(model) or _vote(recorded, fit) != 1:
        return None
    by = Note("divided by {factor:.4g}", factor=factor)
    if factor < 1.0:
        by = Note("multiplied by {factor:.4g}", factor=1.0 / factor)
    cause = Note(
        "{model} fits only with the time {by}; it looks like a wrong unit of time, and {option} says the right one",
        model=spoken_of(model), by=by, option=option("unit", "time=UNIT"),
    )  # fmt: skip
    return Suspicion(e.name, cause.of(e.name), fit)


def _fit(model: Model, e: Experiment) -> float:
    """The fit in %, gain and level left free: they have nothing to do with time."""
    with np.errstate(over="ignore", invalid="ignore"):  # what leads a simulation back is not made for seconds
        return moves(expected(model, e), e.output)[1]


def _vote(recorded: float, divided: float) -> int:
    """1 where the model fits much better with the time divided by a factor, −1 where much worse, 0 where neither."""
    lost = [100.0 - fit if np.isfinite(fit) else np.inf for fit in (recorded, divided)]
    if min(lost) > 100.0 - CRITERIA.poor_fit or min(lost) > CRITERIA.half * max(lost):
        return 0
    return 1 if lost[1] < lost[0] else -1


def _time_factor(interval_s: float, known: Sequence[float]) -> float | None:
    """How many times too far apart the samples are if the unit of time is wrong; None if they are as they were."""
    times = [interval_s / other for other in known]
    if any(abs(np.log(ratio)) < CRITERIA.same_interval for ratio in times):
        return None
    return next((f for f in _TIME_FACTORS for ratio in times if abs(np.log(ratio / f)) < CRITERIA.same_interval), None)


def _quicker(e: Experiment, factor: float) -> Experiment:
    """The experiment in so many times less time."""
    drive = replace(e.drive, interval_s=e.drive.interval_s / factor)
    grid_s = None if e.grid_s is None else e.grid_s / factor
    read_s = None if e.read_s is None else e.read_s / factor
    return replace(e, time_s=e.time_s / factor, drive=drive, grid_s=grid_s, read_s=read_s)
