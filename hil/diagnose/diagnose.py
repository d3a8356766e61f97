"""From a nominal model and recordings to a diagnosis and a corrected model."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from hil.diagnose.answer import Answer
from hil.diagnose.causes import NAMEABLE
from hil.diagnose.check import check
from hil.diagnose.decide import OPEN, Choice, decide, healthy
from hil.diagnose.diagnosis import Diagnosis
from hil.diagnose.events.coarse import all_rounding, coarse, coarse_step
from hil.diagnose.events.event import Events
from hil.diagnose.events.recognise import recognised
from hil.diagnose.events.repeats import stale_outputs, without_stale
from hil.diagnose.measures import LAW_TOLERANCE, SMALL_EXCESS, excess
from hil.diagnose.next_test import Span
from hil.diagnose.problem import Problem, pose
from hil.diagnose.search.fitted import Fitted, evaluated
from hil.diagnose.solver import settled
from hil.diagnose.wording import quantity_text
from hil.identify.experiment import Experiment
from hil.physics.model import Model

Progress = Callable[[float, str], None]

# Rounding is no white noise: what a coarse channel leaves beyond its floor is not taken for more.
_COARSE_EXCESS = 0.1
# Events and a law beside them are looked for so often.
_LOOKS = 2


@dataclass(frozen=True, slots=True)
class Diagnosed:
    """A diagnosis and the model it leads to."""

    diagnosis: Diagnosis
    corrected: Model


def diagnose(
    model: Model,
    experiments: Sequence[Experiment],
    progress: Progress = lambda _done, _text: None,
    span: Span | None = None,
) -> Diagnosed:
    """Compare a nominal model with recordings of its unit, name what it lacks, and correct it.

    Args:
        model: the nominal model.
        experiments: the recordings, bound to its plant.
        progress: told how far it is.
        span: how far a next test may drive the command; as far as the recordings went when not given.

    Raises:
        FileError: a recording cannot be what its headings say (see `hil.diagnose.check`).
    """
    started = time.perf_counter()
    progress(0.0, "checking the recordings")
    checked = check(model, experiments)
    kept, stale = without_stale(checked.experiments)
    problem, solver_warnings = settled(pose(model, kept))
    warnings = [*checked.warnings, *solver_warnings, *_known_hum(model)]
    progress(0.1, "searching for the cause")
    choice = decide(problem)
    if checked.clocks_set and choice.verdict in OPEN:  # one clock is less to believe than many lost commands
        set_right = _posed(problem, without_stale(checked.clocks_set)[0])
        second = decide(set_right)
        if second.verdict not in OPEN:
            problem, choice = set_right, second
            warnings += checked.clock_warnings
    events = choice.events
    beside = _beside_events(problem, choice)
    if beside is not None and (events is None or beside[2].chosen.terms):
        happened, problem, choice = beside
        events = replace(happened, residuals=choice.chosen.residuals)
    progress(0.6, "judging on data kept back")
    if stale:
        events = stale_outputs(
            stale, problem, choice.chosen.residuals if events is None else events.residuals, problem.experiments
        )
    elif events is None and (step := coarse_step(problem, kept)) is not None:
        only = excess(problem, choice.baseline.chi2) < _COARSE_EXCESS
        rounded = all_rounding(problem, choice.baseline, step[0])
        choice = healthy(choice) if only or rounded is not None else choice
        events = coarse(problem, *step, rounded or choice.chosen)
    answer = Answer(problem, choice, events, tuple(warnings), span)
    progress(0.8, "locating the mismatch")
    diagnosis = answer.diagnosis(time.perf_counter() - started)
    progress(1.0, "done")
    return Diagnosed(diagnosis, answer.corrected)


def _posed(problem: Problem, experiments: Sequence[Experiment]) -> Problem:
    """The same question of the experiments on another clock, or without events."""
    return replace(pose(problem.model, experiments), factor=problem.factor)


def _beside_events(problem: Problem, choice: Choice) -> tuple[Events, Problem, Choice] | None:
    """Events, and what explains the rest when they are taken out; None where that stays open.

    A law hides some of the events, and they distort the law: where it explains most of the rest, they are looked for
    beside it once more. Where the events alone explain too little, the law explains the rest if what both leave
    together is within the tolerance of laws.
    """
    most = LAW_TOLERANCE * excess(problem, choice.baseline.chi2) if choice.events is None else 0.0
    happened = _happened(problem, choice)
    looks = 0
    while happened is not None:
        looks += 1
        rest = _posed(problem, happened.rest)
        found = decide(rest, laws_only=True, most=NAMEABLE - 1)
        if found.verdict == "partly_explained" and excess(rest, found.chosen.chi2) <= most:
            found = replace(found, verdict="explained")
        if found.verdict not in OPEN:
            return happened, rest, found
        if found.verdict == "unexplained" or looks == _LOOKS:
            return None
        happened = _beside_law(problem, evaluated(problem, found.chosen))
    return None


def _beside_law(problem: Problem, law: Fitted) -> Events | None:
    """Events that explain all or a part of what a law leaves of the recordings as they are."""
    whole, part = recognised(problem, (law,), excess(problem, law.chi2))
    return whole or part


def _happened(problem: Problem, choice: Choice) -> Events | None:
    """Events beside which there is something more: they leave more than noise, or are a good part of what is open.

    Where laws explain what they should, but leave more than noise, there may be a tone beside them.
    """
    if choice.events is not None:
        return choice.events if excess(problem, choice.events.chi2) > SMALL_EXCESS else None
    left = excess(problem, choice.chosen.chi2)
    if left <= SMALL_EXCESS:
        return None
    is_open = choice.verdict in OPEN
    beside = recognised(problem, (choice.chosen,), left, commands=is_open)
    found = (*beside, choice.part) if is_open else beside
    return min((e for e in found if e is not None), key=lambda e: e.chi2, default=None)


def _known_hum(model: Model) -> tuple[str, ...]:
    noise = model.noise
    if noise is None or noise.hum_hz is None:
        return ()
    size = quantity_text(noise.hum, None, model.definition.output.unit)
    return (f"a hum of {noise.hum_hz:.4g} Hz ({size}) that the healthy unit had too was taken out of the recordings",)
