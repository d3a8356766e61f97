"""Sub-steps of a diagnosis: no coarser than the noise allows, no finer than it needs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.intake.problem import Problem, pose, settled
from hil.diagnosis.search.fits import finished, fit
from hil.diagnosis.search.fitted import Fitted, nothing, residuals_of
from hil.diagnosis.search.terms import all_terms
from hil.physics.model import Value
from hil.physics.simulate import ActiveEffect
from tests.concealed import bound, nominal, posed, records

FRICTION = ActiveEffect("friction", "force", {"coulomb": 3.0, "stiction": 1.3, "stribeck": 5.0, "presliding": 0.02})
DEADBAND = ActiveEffect("deadband", "opening", {"width": 3.0, "ratio": 1.1})

RATE = ActiveEffect("stage_rate", "pilot_step", {"rate": 700.0, "knee": 0.08})


def problem_of(*effects: ActiveEffect, count: int = 3) -> Problem:
    return posed(records(effects, seed=5)[:count])


def fitted(problem: Problem, effect: ActiveEffect) -> Fitted:
    start = nothing(problem)
    term = next(t for t in all_terms(problem, start.residuals) if (t.name, t.hook) == effect.key)
    values = tuple(effect.parameters[u.name] for u in term.unknowns)
    return fit(problem, replace(start, terms=(term,), values=(values,)))


def test_half_the_steps_are_taken_where_they_change_next_to_nothing():
    problem = problem_of()
    taken, warnings = settled(problem)
    assert (taken.factor, warnings) == (0.5, ())
    assert np.sum((taken.nominal_residuals - problem.nominal_residuals) ** 2) < 10.0
    assert taken.excess(nothing(taken).chi2) < 0.03


def test_a_short_recording_keeps_the_steps_of_its_plant():
    assert settled(problem_of(count=2))[0].factor == 1.0


@pytest.mark.parametrize(("share", "least"), [(0.02, 1.0), (1e-4, 4.0)])
def test_less_noise_asks_for_finer_steps(share, least):
    problem = problem_of()
    quiet = replace(problem, noises=tuple(replace(n, std=share * n.std) for n in problem.noises))
    taken, _ = settled(quiet)
    assert taken.factor >= least


def test_friction_is_told_at_the_steps_of_its_plant():
    problem = replace(problem_of(FRICTION), factor=0.5)
    found = fitted(problem, FRICTION)
    told = finished(problem, found)
    own = replace(problem, factor=1.0)
    assert np.array_equal(told.residuals, residuals_of(own, told))
    assert np.sum(told.residuals**2) < 1.001 * np.sum(residuals_of(own, found) ** 2)


def test_a_limit_that_few_steps_reach_is_told_at_the_steps_of_its_plant():
    late = {"dead_time": 0.0189}  # the command arrives within a sub-step
    model = nominal()
    model = replace(model, parameters={**model.parameters, "dead_time": Value(late["dead_time"], "s")})
    problem = replace(pose(model, bound(model, records([RATE], late, seed=5)[:1])), factor=0.5)
    found = fitted(problem, RATE)
    told = finished(problem, found)
    assert told.estimate is not None
    moved = told.values[0][0] - found.values[0][0]
    assert abs(moved) > 0.3 * told.estimate.std[told.estimate_index(told.terms[0])]
    assert np.array_equal(told.residuals, residuals_of(replace(problem, factor=1.0), told))


def test_half_the_steps_are_exact_enough_for_a_dead_band():
    problem = replace(problem_of(DEADBAND), factor=0.5)
    found = fitted(problem, DEADBAND)
    assert np.sqrt(np.mean((residuals_of(problem, found, factor=4.0) - found.residuals) ** 2)) < 0.02
