"""Names that an explanation cannot have: by its own shape, or by the recordings, however well it fits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.search.fitted import Fitted, output_of
from hil.diagnosis.search.terms import Term
from hil.diagnosis.thresholds import MOST
from hil.identification.grey_box.estimate import Unknown
from hil.identification.grey_box.lines import is_commanded
from hil.record.recording import Array
from hil.signals.runs import runs


def is_another_effect(term: Term, values: Sequence[float]) -> bool:
    """Whether a shape that tells an effect from others has ended where the effect would be another one."""
    telling = dict(term.telling)
    return any(
        u.at_bound(value) and _room(u, value, telling[u.name]) < 0.5 * (u.high - u.low)
        for u, value in zip(term.unknowns, values, strict=True)
        if u.name in telling
    )


def _room(u: Unknown, value: float, telling: str) -> float:
    """How far a shape is from where it would be that of another effect."""
    return u.high - value if telling == "upper end" else min(value - u.low, u.high - value)


# A part that is pushed against its stop stays there: most of the time at it passes in stretches of so many samples. A
# model that has drifted there is held for a sample or two, whenever its noisy inputs would take it further.
_STAYS = 10

Key = tuple[str, str]


def refuted(problem: Problem, f: Fitted) -> frozenset[Key]:
    """The terms, by name and hook, of an explanation that cannot be what they say."""
    tests: Mapping[str, Callable[[Problem, Fitted, int], bool]] = {
        "end_stop": _never_reached,
        "periodic_disturbance": _commanded,
    }
    return frozenset(
        term.key for k, term in enumerate(f.terms) if term.name in tests and tests[term.name](problem, f, k)
    )


def _commanded(problem: Problem, f: Fitted, k: int) -> bool:
    """Whether a disturbance has the command's own frequency or one of its harmonics: it is the unit's answer."""
    frequency_hz = f.terms[k].named(f.values[k]).get("frequency")
    return frequency_hz is not None and is_commanded(problem.experiments, frequency_hz)


def _never_reached(problem: Problem, f: Fitted, k: int) -> bool:
    """Whether the recordings go on where the model is held by a stop, or the model has only drifted there.

    While the model rests at a stop, the recording must not go most of the way that the model would have gone without
    it. Only a stop in the output's own unit can be compared with it.
    """
    term = f.terms[k]
    if problem.model.resolved_unit(problem.plant.hook(term.hook).unit) != problem.model.output_unit:
        return False
    place = [hook.name for hook in problem.plant.hooks].index(term.hook)
    stops = term.named(f.values[k])
    recorded = free = 0.0
    long, all_of_it = 0, 0
    traces = problem.traces(f.parameters, [*problem.model.active_effects, *f.effects])
    for e, rows, noise in zip(problem.experiments, traces, problem.noises, strict=True):
        arrives = e.at_stamps(rows)[place]
        held = (arrives > stops["upper"]) | (arrives < stops["lower"])
        goes_on = output_of(problem, f.without(k), e)
        for start, stop in runs(held):
            long, all_of_it = long + (stop - start) * (stop - start >= _STAYS), all_of_it + stop - start
            recorded += max(_way(e.output[start:stop]) - _noise_way(noise.std, stop - start), 0.0)
            free += _way(goes_on[start:stop])
    return recorded > MOST * free or long < MOST * all_of_it


def _way(values: Array) -> float:
    """How far values go from where they begin, at most."""
    return float(np.abs(values - values[0]).max())


def _noise_way(std: float, count: int) -> float:
    """How far noise alone makes so many samples go."""
    return std * (1.0 + float(np.sqrt(2.0 * np.log(max(count, 1)))))
