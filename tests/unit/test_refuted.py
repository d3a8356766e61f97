"""What fits and cannot be: a stop that the recordings do not keep, a disturbance that the command drives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.intake.problem import Problem, pose
from hil.diagnosis.search.fitted import Fitted, evaluated, nothing
from hil.diagnosis.search.terms import all_terms
from hil.diagnosis.verdict.refuted import refuted
from hil.identification.grey_box.lines import is_commanded
from hil.identification.preparation.experiment import experiment
from hil.physics.compose import plant
from hil.physics.model import typical_model
from hil.physics.simulate import ActiveEffect
from tests.answers import answer

FLAP = plant("throttle-flap")
TIME_S = np.arange(0.0, 12.0, 0.01)
STOP = ActiveEffect("end_stop", "stop", {"upper": 4.0, "lower": -50.0})


def posed(command, *concealed, **how) -> Problem:
    made = answer(FLAP, command, 0.01, *concealed, start=2.5, **how)
    return pose(typical_model(FLAP.name), [experiment(made, FLAP)])


def problem(*concealed: ActiveEffect, hz: float = 0.25) -> Problem:
    command = 30.0 * np.sin(2.0 * np.pi * hz * TIME_S)
    return posed(command, *concealed, noise=0.005 * np.random.default_rng(3).standard_normal(len(command)))


def explained_by(asked: Problem, name: str, **values: float) -> Fitted:
    start = nothing(asked)
    term = next(t for t in all_terms(asked, start.residuals) if t.name == name)
    own = tuple(values.get(u.name, u.start) for u in term.unknowns)
    return evaluated(asked, Fitted((term,), (own,), start.parameters, 0.0, start.residuals))


def test_a_stop_that_the_recording_keeps_is_one():
    asked = problem(STOP)
    assert not refuted(asked, explained_by(asked, "end_stop", upper=4.0, lower=-50.0))


def test_a_stop_that_the_recording_passes_is_none():
    asked = problem()
    f = explained_by(asked, "end_stop", upper=4.0, lower=-50.0)
    assert refuted(asked, f) == {("end_stop", "stop")}


@pytest.mark.parametrize(("hz", "is_one"), [(0.25, True), (0.75, True), (0.41, False), (7.0, False)])
def test_what_the_command_drives_is_no_disturbance(hz, is_one):
    asked = problem()
    f = explained_by(asked, "periodic_disturbance", frequency=hz)
    assert bool(refuted(asked, f)) == is_one
    assert is_commanded(asked.experiments, hz) == is_one


def test_a_frequency_that_one_recording_alone_is_driven_at_may_be_a_disturbance():
    both = (*problem(hz=0.25).experiments, *problem(hz=0.9).experiments)
    assert not is_commanded(both, 0.25)


def test_what_is_refuted_is_not_looked_for():
    asked = replace(problem(), refuted=frozenset({("end_stop", "stop")}))
    assert not any(t.name == "end_stop" for t in all_terms(asked, nothing(asked).residuals))


def test_bounds_follow_what_passes():
    """A flap driven three times as far as its full scale may stick three times as much."""
    command = 150.0 * np.sin(2.0 * np.pi * 0.25 * TIME_S)
    asked = posed(command)
    term = next(t for t in all_terms(asked, nothing(asked).residuals) if t.name == "friction")
    assert term.unknowns[0].high == pytest.approx(0.2 * 150.0)
