"""What has changed since identification, on a model that left more than noise then: one gate, then a name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from hil.cores import parallel_map
from hil.diagnosis.intake.problem import COARSER, Problem
from hil.diagnosis.search.effort import EFFORT, Steps
from hil.diagnosis.search.fitted import Fitted, evaluated, nothing, starting
from hil.diagnosis.search.terms import Term, all_terms
from hil.diagnosis.skeleton.gate import Later, later_of
from hil.diagnosis.skeleton.rows import Rows, answers, samples_in
from hil.diagnosis.skeleton.table import Table
from hil.diagnosis.thresholds import PLAINLY, TINY
from hil.diagnosis.verdict.choice import Choice
from hil.diagnosis.verdict.score import UNKNOWN, Hypothesis, Noise, table
from hil.identification.grey_box.estimate import estimate
from hil.language.note import Note
from hil.physics.plant import Parameters
from hil.physics.simulate import ActiveEffect
from hil.record.recording import Array, Integers, Mask


@dataclass(frozen=True)
class Changed:
    """Later recordings beside what is known of before.

    Attributes:
        problem: the question.
        table: of the recordings of before. `rows`: the later ones, in the rows of that table.
    """

    problem: Problem
    table: Table
    rows: Rows

    @cached_property
    def later(self) -> Later:
        """The recordings on the scale of before."""
        return later_of(self.table.before, self.rows)

    @property
    def needed(self) -> float:
        """The z from which it is an alarm."""
        return self.table.before.needed(alone=self.later.alone)

    @property
    def is_alarm(self) -> bool:
        """Whether the unit has changed."""
        return self.later.z >= self.needed

    @property
    def is_unsure(self) -> bool:
        """Whether one recording alone makes an alarm near the threshold, or is of a kind unlike all of before."""
        strange = self.later.leverage > self.table.before.leverage
        return self.is_alarm and self.later.alone and (self.later.z < PLAINLY * self.needed or strange)

    @property
    def correlated_rows(self) -> float:
        """How many rows tell as much as one."""
        return max(self.table.before.least, 1.0)

    @property
    def count(self) -> float:
        """So many independent rows there are: χ² that the remainder leaves."""
        return max(float(np.count_nonzero(self.rows.valid)) / self.correlated_rows, 1.0)

    @property
    def left_as_it_was(self) -> Array:
        """What `residuals` are of the unit as it was, which nothing need be simulated for; shape (n,)."""
        return self._weight * self.later.left

    def residuals(self, parameters: Parameters, effects: Sequence[ActiveEffect]) -> Array:
        """What a changed model leaves of the rows, without the skeleton misfit; shape (n,).

        Over the scale of the left-out remainder and the root of how many rows tell as much as one, so that an unchanged
        unit leaves `count`; 0 where nothing was measured.
        """
        change = np.nan_to_num(self._answers(parameters, effects) - self._nominal)
        return self._weight * (self.later.left + change)

    @cached_property
    def _weight(self) -> Array:
        return np.where(self.rows.valid, 1.0 / (math.sqrt(self.correlated_rows) * self.later.std), 0.0)

    @cached_property
    def _nominal(self) -> Array:
        return self._answers(self.problem.model.values, self.problem.model.active_effects)

    def _answers(self, parameters: Parameters, effects: Sequence[ActiveEffect]) -> Array:
        model, table, experiments = self.problem.model, self.table, self.problem.experiments
        self.problem.work.simulated(len(experiments), sum(e.drive.inputs.shape[1] for e in experiments))
        parts = parallel_map(
            lambda e: answers(model, e, table.floors, table.row_s, parameters, effects, COARSER), experiments
        )
        return np.concatenate([rows for channels in parts for rows in channels.values()])

    def folds(self, of_residuals: Integers) -> Integers:
        """The fold of every row, shape (n,), from those of the residuals of the question."""
        found = np.zeros(len(self.rows.recording), dtype=np.int64)
        for k, (e, part) in enumerate(zip(self.problem.experiments, self.problem.output_slices(), strict=True)):
            own = self.rows.recording == k
            for channel in np.unique(self.rows.channel[own]):
                at = np.flatnonzero(own & (self.rows.channel == channel))
                found[at] = of_residuals[part][np.arange(len(at)) * samples_in(self.table.row_s, e)]
        return found

    def unsure(self) -> Note | None:
        """In words what one recording alone leaves open; None where nothing."""
        if not self.is_unsure:
            return None
        return Note(
            "one recording alone says so (z = {z:.1f}, {needed:.1f} is needed): the change is unsure. Record the test "
            "that the model was identified from once more; it settles this",
            z=self.later.z, needed=self.needed,
        )  # fmt: skip


def unchanged(changed: Changed) -> Choice:
    """Below the gate nothing is named, whatever a hypothesis gains."""
    nominal = nothing(changed.problem)
    terms = all_terms(changed.problem, nominal.residuals)
    return Choice("consistent", nominal, nominal, nominal, (), (), terms, 1.0)


def named(changed: Changed) -> Choice:
    """What has changed, by the one score; base parameters stay where identification knew them."""
    problem = changed.problem
    nominal = nothing(problem)
    terms = all_terms(problem, nominal.residuals)
    problem.work.at(0.2, "fitting what may have changed")
    fits = _fitted(changed, terms)
    factor, as_it_was = changed.table.before.within(len(problem.experiments)), changed.left_as_it_was
    noise = Noise(changed.count, 1.0 / factor, factor, changed.count, len({term.label for term in terms}))
    every = [Hypothesis((), float(as_it_was @ as_it_was)), *map(_hypothesis, fits)]
    scores = table(noise, every).without("consistent")  # the gate refutes that
    by_label = {_hypothesis(f).named: f for f in reversed(fits)}
    ranked = [by_label[key] for row in scores.rows if not row.is_open and (key := row.hypothesis.named) in by_label]
    best = by_label.get(scores.first.hypothesis.named, ranked[0])
    names = list(dict.fromkeys(name for row in scores.ambiguous for name in row.hypothesis.named))
    left, whole = (max(chi2 - changed.count, 0.0) for chi2 in (best.chi2, float(as_it_was @ as_it_was)))
    chances = {name: scores.chance(name) for key in by_label for name in key}
    others = names[1:] or ([UNKNOWN] if scores.first.verdict == "unexplained" and names else [])
    shown = [evaluated(problem, f) for f in (best, *(f for f in ranked if f is not best))]
    return Choice(
        scores.first.verdict, shown[0], nominal, nominal, tuple(shown), tuple((names[0], name) for name in others),
        terms, left / max(whole, TINY), alike=tuple(names), chances=chances, table=scores,
    )  # fmt: skip


def refitted(changed: Changed, f: Fitted, keep: Mask) -> Fitted:
    """A cause fitted to some of the residuals, with what it leaves of all."""
    rows = changed.folds(keep.astype(np.int64)) > 0
    return evaluated(changed.problem, _fit(changed, f.terms[0], f.values[0], EFFORT.rough, rows))


def _hypothesis(f: Fitted) -> Hypothesis:
    changed = () if f.names else (f.terms[0].name,)
    return Hypothesis(f.names, f.chi2, 1, f.unknowns, changed)


def _fitted(changed: Changed, terms: Sequence[Term]) -> list[Fitted]:
    """The terms that could leave least from either of their two best starts, at their best; the best places first."""
    tried = parallel_map(partial(_nearer, changed), _likely(changed, terms))
    coarse = parallel_map(lambda one: _fit(changed, *one, EFFORT.rough), tried)
    first: dict[str, Fitted] = {}
    for f in sorted(coarse, key=lambda f: f.chi2):
        first.setdefault(f.terms[0].label, f)
    fits = list(first.values())
    further = parallel_map(lambda f: _fit(changed, f.terms[0], f.values[0], EFFORT.fine), fits[: 2 * EFFORT.finished])
    return sorted((*further, *fits[2 * EFFORT.finished :]), key=lambda f: f.chi2)


@dataclass(frozen=True, slots=True)
class _Start:
    """A start of a term: what it leaves, and the least on the straight line to it from nothing, at which share."""

    term: Term
    values: tuple[float, ...]
    left: float
    least: float
    share: float


def _likely(changed: Changed, terms: Sequence[Term]) -> list[_Start]:
    """Starts of the terms that could leave least, if all that they do grew with their strength."""
    starts = [(term, start) for term in terms if not term.by_clock for start in term.starts]
    likely: dict[Term, list[_Start]] = {}
    for one in sorted(parallel_map(partial(_start, changed), starts), key=lambda s: s.least):
        likely.setdefault(one.term, []).append(one)
    return [one for own in list(likely.values())[: 2 * EFFORT.tried] for one in own[:2]]


def _start(changed: Changed, one: tuple[Term, tuple[float, ...]]) -> _Start:
    r, as_it_was = _residuals(changed, *one), changed.left_as_it_was
    change = r - as_it_was
    share = float(np.clip(-(change @ as_it_was) / np.maximum(change @ change, TINY), 0.0, 1.0))
    least = as_it_was + share * change
    return _Start(*one, float(r @ r), float(least @ least), share)


def _nearer(changed: Changed, start: _Start) -> tuple[Term, tuple[float, ...]]:
    """A start, or where the straight line from nothing to it is lowest, if that leaves less indeed."""
    term = start.term
    if term.kind == "parameter":
        values: tuple[float, ...] = (term.nominal + start.share * (start.values[0] - term.nominal),)
    else:
        values = term.scaled(start.values, start.share)
    r = _residuals(changed, term, values)
    return term, values if float(r @ r) < start.left else start.values


def _residuals(changed: Changed, term: Term, values: Sequence[float]) -> Array:
    parameters = dict(changed.problem.model.values)
    effects: list[ActiveEffect] = list(changed.problem.model.active_effects)
    term.apply(values, parameters, effects)
    return changed.residuals(parameters, effects)


def _fit(changed: Changed, term: Term, start: Sequence[float], steps: Steps, keep: Mask | None = None) -> Fitted:
    def residuals(values: Array) -> Array:
        r = _residuals(changed, term, values.tolist())
        return r if keep is None else np.where(keep, r, 0.0)

    found = estimate(
        residuals, starting(term.unknowns, start), max_evaluations=steps.evaluations, tolerance=steps.tolerance
    )
    values = tuple(found.values.tolist())
    moved = dict(changed.problem.model.values) | ({term.name: values[0]} if term.kind == "parameter" else {})
    return Fitted((term,), (values,), moved, found.chi2, found.residuals, found)
