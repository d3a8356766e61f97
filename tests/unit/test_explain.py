"""What a set of causes costs: a parameter that has to have changed for it counts as a named one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hil.diagnosis.intake.problem import Problem, pose
from hil.diagnosis.search.fitted import nothing
from hil.diagnosis.search.terms import Term, all_terms
from hil.diagnosis.verdict.explain import Option
from hil.identification.preparation.experiment import experiment
from hil.physics.compose import plant
from hil.physics.model import Noise, typical_model
from tests.answers import answer

FLAP = plant("throttle-flap")


def asked() -> Problem:
    time_s = np.arange(0.0, 10.0, 0.02)
    command = 12.0 * np.sign(np.sin(2.0 * np.pi * 0.4 * time_s))
    model = replace(typical_model(FLAP.name), noise=Noise(0.01))
    return pose(model, [experiment(answer(FLAP, command, 0.02, start=2.5), FLAP)])


def with_moved(problem: Problem, term: Term, moved: int) -> Option:
    """An effect beside so many parameters that are far from where they were identified."""
    unit = nothing(problem)
    far = {p.name: p.high for p in problem.base[:moved]}
    fitted = replace(unit, terms=(term,), values=(term.starts[0],), parameters={**unit.parameters, **far})
    return Option(problem, fitted, (), fitted.residuals, 1.0)


def test_every_parameter_that_has_to_change_for_an_effect_is_a_cause():
    problem = asked()
    effect = next(t for t in all_terms(problem, problem.nominal_residuals) if t.kind == "effect")
    alone, one, three = (with_moved(problem, effect, k).hypothesis(()) for k in (0, 1, 3))
    assert (one.causes, one.unknowns) == (alone.causes + 1, alone.unknowns + 1)
    assert (three.causes, three.unknowns) == (alone.causes + 3, alone.unknowns + 3)


def test_what_the_model_lacked_had_bent_its_parameters_and_moving_them_back_is_no_cause():
    """In the recordings that it was identified from: what these tell of the parameters is not known beside them."""
    problem = asked()
    own = replace(problem, is_own=True)
    later, before = (
        with_moved(p, next(t for t in all_terms(p, p.nominal_residuals) if t.name == "friction"), 2).hypothesis(())
        for p in (problem, own)
    )
    assert (later.causes, before.causes) == (3, 1)
    assert not [t for t in all_terms(own, own.nominal_residuals) if t.kind == "parameter"]
