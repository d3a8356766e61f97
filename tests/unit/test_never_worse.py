"""A corrected model replaces the nominal one only where it is better on what no fit has seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.answer.answer import Answer
from hil.diagnosis.evidence.cross_validation import by_sign_changes
from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.question import Question
from hil.diagnosis.verdict.choice import Choice
from hil.diagnosis.verdict.explain import explained
from hil.physics.simulate import ActiveEffect
from tests.concealed import posed, records


def test_gains_in_every_block_are_no_chance():
    assert by_sign_changes(np.ones(6)) == 1.0 / 64.0
    assert by_sign_changes(np.ones(5)) == 1.0 / 32.0


def test_as_many_losses_as_gains_are():
    assert by_sign_changes(np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])) > 0.5
    assert by_sign_changes(np.array([9.0, -1.0, -1.0, -1.0, -1.0, -1.0, -1.0])) > 0.4


def test_many_blocks_are_drawn():
    rng = np.random.default_rng(1)
    assert by_sign_changes(rng.normal(1.0, 1.0, 40)) < 0.01
    assert by_sign_changes(rng.normal(-1.0, 1.0, 40)) > 0.9


@pytest.fixture(scope="module")
def uneven():
    effect = ActiveEffect("asymmetry", "flow", {"ratio": 0.85, "gain": 1.0})
    problem = posed(records((effect,), seed=9))
    return explained(problem)


def answer_of(problem: Problem, choice: Choice) -> Answer:
    return Answer(problem, choice, (), None, Question("left_out", "no table"))


def test_what_predicts_better_is_named_and_stands_in_the_file(uneven):
    answer = answer_of(*uneven)
    told = answer.diagnosis(0.0)
    assert (told.verdict, told.corrected_is) == ("explained", "named")
    assert [e.name for e in told.effects] == [e.name for e in answer.corrected.effects] == ["asymmetry"]


@pytest.mark.parametrize("is_worse", [False, True])
def test_what_is_not_better_beyond_chance_or_worse_keeps_its_name_and_is_not_in_the_file(is_worse, uneven, monkeypatch):
    problem, choice = uneven
    if is_worse:
        monkeypatch.setattr("hil.diagnosis.answer.answer.predicted", lambda *_: 1.1 * choice.nominal.residuals)
    else:
        monkeypatch.setattr("hil.diagnosis.answer.answer.why_not_better", lambda *_: "it may be chance")
    answer = answer_of(problem, choice)
    told = answer.diagnosis(0.0)
    assert (told.verdict, told.corrected_is) == ("explained", "nominal")
    assert [e.name for e in told.effects] == ["asymmetry"]
    assert answer.corrected.effects == ()
    if is_worse:
        assert any("the corrected model is the nominal one" in warning for warning in told.warnings)
        assert told.held_out.corrected == told.held_out.nominal
    else:
        assert told.why_corrected == "it may be chance"


def test_a_description_is_never_in_the_file(uneven):
    problem, choice = uneven
    answer = answer_of(problem, replace(choice, verdict="unexplained"))
    told = answer.diagnosis(0.0)
    assert (told.corrected_is, told.effects) == ("nominal", ())
    assert answer.corrected.effects == ()
    assert any("the closest description (asymmetry" in w for w in told.warnings)
