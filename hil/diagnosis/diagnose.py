"""From a nominal model and recordings to a diagnosis and a corrected model."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from hil.diagnosis.answer import Answer
from hil.diagnosis.as_before import WHAT_IT_LACKS, as_before, is_asked_what_changed, with_inner_noise
from hil.diagnosis.check import check
from hil.diagnosis.decide import OPEN, decide, healthy
from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.events.coarse import coarse_step
from hil.diagnosis.events.event import Spell
from hil.diagnosis.events.repeats import stale_outputs, without_stale
from hil.diagnosis.happened import Happened, happened, posed_again
from hil.diagnosis.levels import read_coarsely
from hil.diagnosis.next_test import Span
from hil.diagnosis.problem import pose
from hil.diagnosis.roughly_known import as_in_this_unit
from hil.diagnosis.solver import settled
from hil.diagnosis.wording import quantity_text
from hil.diagnosis.work import Progress, Work
from hil.identification.experiment import Experiment
from hil.physics.model import Model
from hil.signals.products import one_blas_thread


@dataclass(frozen=True, slots=True)
class Diagnosed:
    """A diagnosis and the model it leads to."""

    diagnosis: Diagnosis
    corrected: Model

    def _repr_html_(self) -> str:
        from hil.record.show import table_html

        told = self.diagnosis
        rows = [(f.name, f"{100 * f.probability:.0f} %", f.sentence) for f in told.effects]
        return table_html(("effect", "probability", "in words"), rows, f"{told.verdict}: {told.headline}")

    def plot(self) -> Any:
        """A matplotlib figure: what each recording and the two models differ by, the nominal and the corrected one."""
        from matplotlib.figure import Figure

        shown = self.diagnosis.strips
        figure = Figure(figsize=(8.0, 1.2 + 2.0 * len(shown)), layout="constrained")
        axes = figure.subplots(len(shown), 1, squeeze=False)[:, 0]
        for axis, strip in zip(axes, shown, strict=True):
            axis.plot(strip.time_s, strip.off(strip.nominal), linewidth=1.0, label="recording − nominal model")
            axis.plot(strip.time_s, strip.off(strip.corrected), linewidth=1.0, label="recording − corrected model")
            axis.set_title(strip.name, fontsize="small", loc="left")
            axis.set_ylabel(self.corrected.output)
            axis.set_xlabel("time [s]")
        axes[0].legend(fontsize="small")
        return figure


def diagnose(
    model: Model,
    experiments: Sequence[Experiment],
    progress: Progress = lambda _done, _text: None,
    span: Span | None = None,
    budget_s: float = math.inf,
) -> Diagnosed:
    """Compare a nominal model with recordings of its unit, name what it lacks, and correct it.

    Args:
        model: the nominal model.
        experiments: the recordings, bound to its plant.
        progress: told how far it is.
        span: how far a next test may drive the command; as far as the recordings went when not given.
        budget_s: computing time after which no further search is begun; what was left out is said.

    Raises:
        FileError: a recording cannot be what its headings say (see `hil.diagnosis.check`).
    """
    with one_blas_thread():
        return _diagnose(model, experiments, Work(progress, budget_s), span)


def _diagnose(model: Model, experiments: Sequence[Experiment], work: Work, span: Span | None) -> Diagnosed:
    started = time.perf_counter()
    work.at(0.0, "checking the recordings")
    checked = check(model, experiments)
    kept, stale = without_stale(checked.experiments)
    problem = replace(pose(model, kept), work=work)
    what_changed = is_asked_what_changed(problem)
    problem, solver_warnings = settled(with_inner_noise(problem) if what_changed else problem)
    warnings = [*checked.warnings, *solver_warnings, *_known_hum(model)]
    work.at(0.1, "searching for the cause")
    choice = decide(problem)
    if checked.clocks_set and choice.verdict in OPEN:  # one clock is less to believe than many lost commands
        set_right = posed_again(problem, without_stale(checked.clocks_set)[0])
        second = decide(set_right)
        if second.verdict not in OPEN:
            problem, choice = set_right, second
            warnings += checked.clock_warnings
    problem, no_news = as_in_this_unit(problem, choice)
    if no_news:
        choice = decide(problem)
        warnings += no_news
    standing = as_before(problem) if what_changed else ""
    if standing:
        choice = healthy(choice)
        warnings.append(WHAT_IT_LACKS)
    found = Happened((), problem, choice) if standing else happened(problem, choice)
    work.at(0.6, "judging on data kept back")
    if (step := coarse_step(problem, kept)) is not None:
        found = read_coarsely(found, *step)
    if stale:
        found = _with_stale(found, stale)
    answer = Answer(found, (*warnings, *work.warnings), span, standing)
    work.at(0.8, "locating the mismatch")
    diagnosis = answer.diagnosis(time.perf_counter() - started)
    work.at(1.0, "done")
    return Diagnosed(diagnosis, answer.corrected)


def _with_stale(found: Happened, stale: Sequence[Spell]) -> Happened:
    """Samples that were seen at once to repeat, and those that only a model showed, as one."""
    sensor, problem = found.problem.plant.hooks[-1].name, found.problem
    shown = next((e for e in found.events if e.name == "dropout" and e.hook == sensor), None)
    spells = (*stale, *shown.spells) if shown is not None else stale
    every = stale_outputs(spells, problem, found.residuals, problem.experiments)
    return found.also(every) if shown is None else found.with_another(every, shown)


def _known_hum(model: Model) -> tuple[str, ...]:
    noise = model.noise
    if noise is None or noise.hum_hz is None:
        return ()
    size = quantity_text(noise.hum, None, model.output_unit)
    return (f"a hum of {noise.hum_hz:.4g} Hz ({size}) that the healthy unit had too was taken out of the recordings",)
