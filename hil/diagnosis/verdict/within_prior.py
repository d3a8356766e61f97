"""Sizes of effects that the nominal model has and was never sure of: what they are in this unit is no news."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.search.terms import Term
from hil.diagnosis.thresholds import SELDOM_BY_CHANCE
from hil.diagnosis.verdict.choice import Choice
from hil.diagnosis.wording import quantity_text
from hil.language.note import Note
from hil.physics.compose import effect as installed_effect
from hil.physics.model import Model, ModelEffect


def nominal_of_this_unit(problem: Problem, choice: Choice) -> tuple[Problem, tuple[Note, ...]]:
    """The question with such sizes as they were found, no farther off than was known, and a word on each.

    The same question and no words where there are none.
    """
    found = choice.chosen.pairs if choice.verdict != "unexplained" else ()
    near = [(term, values) for term, values in found if is_within_prior(problem.model, term, values)]
    if not near:
        return problem, ()
    moved = {term.key: (term, values) for term, values in near}
    effects = tuple(_moved(e, *moved[e.key]) if e.key in moved else e for e in problem.model.effects)
    notes = tuple(text for term, values in near for text in _words(term, values))
    return replace(problem, model=replace(problem.model, effects=effects)), notes


def is_within_prior(model: Model, term: Term, values: Sequence[float]) -> bool:
    """Whether these sizes of an effect that the model has are no farther off than was known."""
    if not term.held:
        return False
    had = next(e for e in model.effects if e.key == term.key)
    return all(
        abs(value - null) <= SELDOM_BY_CHANCE * (had.parameters[u.name].std or 0.0)
        for u, value, null in zip(term.unknowns, values, term.nulls, strict=True)
    )


def _moved(had: ModelEffect, term: Term, values: Sequence[float]) -> ModelEffect:
    now = {u.name: replace(had.parameters[u.name], value=float(v)) for u, v in zip(term.unknowns, values, strict=True)}
    return replace(had, parameters={**had.parameters, **now})


def _words(term: Term, values: Sequence[float]) -> Iterator[Note]:
    meanings = {p.name: p.meaning for p in installed_effect(term.name).parameters}
    for u, value, was in zip(term.unknowns, values, term.nulls, strict=True):
        yield Note(
            "{effect}: {meaning} is {now} instead of {was}, within what was known of it. The corrected model has it",
            effect=term.label, meaning=Note(meanings[u.name]), now=quantity_text(value, None, u.unit),
            was=quantity_text(was, None, u.unit),
        )  # fmt: skip
