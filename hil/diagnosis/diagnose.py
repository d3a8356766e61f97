"""From a nominal model and recordings to a diagnosis and a corrected model."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from hil.diagnosis.answer.answer import Answer
from hil.diagnosis.answer.next_test import Span
from hil.diagnosis.diagnosis import Diagnosis, DiagnosisVerdict
from hil.diagnosis.events.coarse import coarse, coarse_step
from hil.diagnosis.events.event import Events, Interval
from hil.diagnosis.events.repeats import stale_outputs, without_stale
from hil.diagnosis.intake.check import Checked, check
from hil.diagnosis.intake.problem import Problem, pose, settled
from hil.diagnosis.intake.work import Work
from hil.diagnosis.question import Question, question_of
from hil.diagnosis.verdict.changed import Changed, named, unchanged
from hil.diagnosis.verdict.choice import OPEN, Choice
from hil.diagnosis.verdict.explain import explained, posed_again
from hil.diagnosis.verdict.within_prior import nominal_of_this_unit
from hil.diagnosis.wording import quantity_text
from hil.identification.preparation.experiment import Experiment
from hil.language.note import Note
from hil.physics.model import Model
from hil.record.recording import Array
from hil.record.run_folder.progress import Progress, quiet
from hil.record.show import table_html
from hil.signals.products import one_blas_thread

_WITH_EVENTS: Mapping[DiagnosisVerdict, DiagnosisVerdict] = {
    "consistent": "explained", "parameter_change": "explained", "unexplained": "partly_explained",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Diagnosed:
    """A diagnosis and the model it leads to."""

    diagnosis: Diagnosis
    corrected: Model

    def _repr_html_(self) -> str:
        found = self.diagnosis
        rows = [(f.name, f"{100 * f.probability:.0f} %", f.sentence) for f in found.effects]
        return table_html(("effect", "probability", "in words"), rows, f"{found.verdict}: {found.headline}")

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
    progress: Progress = quiet,
    span: Span | None = None,
    budget_s: float = math.inf,
    question: str = "",
    before: Sequence[Experiment] = (),
) -> Diagnosed:
    """Compare a nominal model with recordings of its unit, name what it lacks, and correct it.

    Args:
        model: the nominal model.
        experiments: the recordings, bound to its plant.
        progress: called with how far it is.
        span: how far a next test may drive the command; as far as the recordings went when not given.
        budget_s: after so many times 10 million simulated samples no search is begun; what was left out is said.
        question: "changed" or "left_out", where not the one that the recordings themselves ask.
        before: recordings of the same unit when the model was identified, where not what the model file keeps of them.

    Raises:
        FileError: a recording cannot be what its headings say (see `hil.diagnosis.intake.check`).
    """
    with one_blas_thread():
        return _diagnose(model, experiments, Work(progress, budget_s), span, question, before)


def _diagnose(
    model: Model, experiments: Sequence[Experiment], work: Work, span: Span | None, wanted: str,
    before: Sequence[Experiment],
) -> Diagnosed:  # fmt: skip
    started = time.perf_counter()
    work.at(0.0, "checking the recordings")
    asked = question_of(model, experiments, wanted, before)
    checked = check(model, experiments)
    kept, stale = without_stale(checked.experiments)
    problem = replace(pose(model, kept), work=work, is_own=asked.is_own)
    problem, solver_warnings = settled(problem)
    warnings = [*asked.warnings, *checked.warnings, *solver_warnings, *_known_hum(model)]
    changed = _beyond_noise(problem, asked)
    coarsely = coarse_step(problem, kept)
    if changed is None:
        problem, choice, notes = _searched(problem, checked, stale, coarsely)
    else:
        problem, choice, notes = _judged(changed)
        if stale:
            choice = _with_stale(problem, choice, stale)
    if coarsely is not None:
        choice = _with(choice, coarse(problem, *coarsely, choice.chosen, _residuals(choice)))
    work.at(0.6, "judging on data kept back")
    answer = Answer(problem, choice, (*warnings, *notes, *work.warnings), span, asked, changed)
    work.at(0.8, "locating the mismatch")
    diagnosis = answer.diagnosis(time.perf_counter() - started)
    work.at(1.0, "done")
    return Diagnosed(diagnosis, answer.corrected)


def _beyond_noise(problem: Problem, asked: Question) -> Changed | None:
    """The recordings beside those of before, where *changed* is asked of a model that left more than noise of them.

    A model that left nothing but noise lacks nothing: there the search itself says what has changed.
    """
    table = asked.table
    if table is None or table.beyond_noise < problem.noise_uncertainty:
        return None
    problem.work.at(0.05, "has the unit changed?")
    count = 2 + len(table.columns)
    samples = sum(e.drive.inputs.shape[1] for e in problem.experiments)
    problem.work.simulated(count * len(problem.experiments), count * samples)
    return Changed(problem, table, table.rows(problem.model, problem.experiments))


def _judged(changed: Changed) -> tuple[Problem, Choice, list[Note]]:
    """One gate before any name."""
    if not changed.is_alarm:
        return changed.problem, unchanged(changed), []
    return changed.problem, named(changed), [notes for notes in [changed.unsure()] if notes]


def _searched(
    problem: Problem, checked: Checked, stale: Sequence[Interval], coarsely: tuple[float, float] | None
) -> tuple[Problem, Choice, list[Note]]:
    """What the model leaves out, by the search over the whole library and for events."""
    problem.work.at(0.1, "searching for the cause")
    if coarsely is not None:
        problem = replace(problem, step=coarsely[0])
    known = [*(["dropout"] if stale else []), *(["quantisation"] if coarsely else [])]
    posed, choice = explained(problem, known)
    warnings: list[Note] = []
    if stale and choice.verdict in OPEN and not (choice.chosen.terms or choice.events):  # they explain nothing
        known.remove("dropout")
        posed, choice = explained(problem, known)
        harmless = Note(
            "{times} × the recording repeats its last value; these samples are left out, and the misfit stays as it is",
            times=len(stale),
        )  # fmt: skip
        stale, warnings = (), [harmless]
    if checked.clocks_set and choice.verdict in OPEN:  # one clock is less to believe than many lost commands
        set_right = posed_again(problem, without_stale(checked.clocks_set)[0])
        again, second = explained(set_right, known)
        if second.verdict not in OPEN:
            problem, posed, choice = set_right, again, second
            warnings += checked.clock_warnings
    problem, notes = nominal_of_this_unit(problem, choice)
    if notes:
        posed, choice = explained(problem, known)
        warnings += notes
    if stale:
        choice = _with_stale(posed, choice, stale)
    return posed, choice, warnings


def _with_stale(problem: Problem, choice: Choice, stale: Sequence[Interval]) -> Choice:
    """Samples that were seen at once to repeat, and those that only a model showed, as one."""
    sensor = problem.plant.hooks[-1].name
    shown = [e for e in choice.events if e.name == "dropout" and e.hook == sensor]
    intervals = [*stale, *(interval for e in shown for interval in e.intervals)]
    others = tuple(e for e in choice.events if e not in shown)
    every = stale_outputs(intervals, problem, _residuals(choice), problem.experiments)
    return _with(replace(choice, events=others), every)


def _with(choice: Choice, events: Events) -> Choice:
    """Beside what was chosen, events that were read off the recordings: there whatever the gate and the laws say."""
    chances = {name: chance for name, chance in choice.chances.items() if name != events.name}
    verdict = _WITH_EVENTS.get(choice.verdict, choice.verdict)
    left = 0.0 if choice.verdict == "consistent" else choice.left
    return replace(choice, verdict=verdict, left=left, events=(*choice.events, events), chances=chances)


def _residuals(choice: Choice) -> Array:
    return choice.chosen.residuals if choice.residuals is None else choice.residuals


def _known_hum(model: Model) -> tuple[Note, ...]:
    noise = model.noise
    if noise is None or noise.hum_hz is None:
        return ()
    size = quantity_text(noise.hum, None, model.output_unit)
    hum = Note("a hum of {frequency_hz:.4g} Hz ({size}) that the healthy unit had too was taken out of the recordings",
               frequency_hz=noise.hum_hz, size=size)  # fmt: skip
    return (hum,)
