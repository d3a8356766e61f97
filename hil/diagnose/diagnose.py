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
from hil.diagnose.events.coarse import coarse, coarse_step
from hil.diagnose.events.event import Events
from hil.diagnose.events.recognise import recognised
from hil.diagnose.events.repeats import stale_outputs, without_stale
from hil.diagnose.measures import SMALL_EXCESS, excess
from hil.diagnose.next_test import Span
from hil.diagnose.problem import Problem, pose
from hil.diagnose.solver import settled
from hil.diagnose.wording import quantity_text
from hil.identify.experiment import Experiment
from hil.physics.model import Model

Progress = Callable[[float, str], None]

# Rounding is no white noise: what a coarse channel leaves beyond its floor is not taken for more.
_COARSE_EXCESS = 0.1


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
        second = _explained(problem, without_stale(checked.clocks_set)[0])
        if second is not None:
            problem, choice = second
            warnings += checked.clock_warnings
    events = choice.events
    happened = _happened(problem, choice)
    second = None if happened is None else _explained(problem, happened.rest, beside_events=True)
    if happened is not None and second is not None and (events is None or second[1].chosen.terms):
        problem, choice = second
        events = replace(happened, residuals=choice.chosen.residuals)
    progress(0.6, "judging on data kept back")
    if stale:
        events = stale_outputs(
            stale, problem, choice.chosen.residuals if events is None else events.residuals, problem.experiments
        )
    elif events is None and (step := coarse_step(problem, kept)) is not None:
        only = excess(problem, choice.baseline.chi2) < _COARSE_EXCESS
        choice = healthy(choice) if only else choice
        events = coarse(problem, *step, choice.chosen)
    answer = Answer(problem, choice, events, tuple(warnings), span)
    progress(0.8, "locating the mismatch")
    diagnosis = answer.diagnosis(time.perf_counter() - started)
    progress(1.0, "done")
    return Diagnosed(diagnosis, answer.corrected)


def _explained(
    problem: Problem, experiments: Sequence[Experiment], *, beside_events: bool = False
) -> tuple[Problem, Choice] | None:
    """A second look, at the experiments on another clock or without events; None if that is still open."""
    other = replace(pose(problem.model, experiments), factor=problem.factor)
    choice = decide(other, laws_only=beside_events, most=NAMEABLE - 1 if beside_events else NAMEABLE)
    return None if choice.verdict in OPEN else (other, choice)


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
