"""A coarse channel: its step is read off all levels, and what rounding does is taken for nothing else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hil.diagnosis.events.coarse import lattice
from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.search.effort import EFFORT
from hil.diagnosis.search.fits import fit
from hil.diagnosis.search.fitted import Fitted, evaluated, nothing
from hil.diagnosis.search.terms import all_terms
from hil.physics.simulate import ActiveEffect
from tests.concealed import posed, records

FINE = 0.01


@settings(max_examples=40)
@example(seed=0, step=1.3800639474034435, missing=0.0)
@given(seed=st.integers(0, 10_000), step=st.floats(0.3, 5.0), missing=st.floats(0.0, 0.7))
def test_the_step_is_known_better_than_the_converter_rounds(seed, step, missing):
    rng = np.random.default_rng(seed)
    number = np.flatnonzero(rng.uniform(size=120) >= missing)
    levels = np.unique(FINE * np.rint((step * (number - 40) + 0.3) / FINE))
    found, std = lattice(levels, float(np.diff(levels).min()), FINE)
    assert std < 0.1 * FINE
    assert abs(found - step) < 5.0 * std


def test_two_levels_give_no_line():
    found, std = lattice(np.array([1.0, 2.5]), 1.5, FINE)
    assert found == 1.5
    assert std == pytest.approx(FINE / 6.0**0.5)


STEP = 4.0


def read_in_steps(
    effects: tuple[ActiveEffect, ...], to_whole: Callable[[np.ndarray], np.ndarray], step: float = STEP
) -> Problem:
    made = records(effects, seed=12)
    for each in made:
        flow = each.channels["flow"].values
        flow[:] = step * to_whole(flow / step)
    return posed(made)


def off(problem: Problem, step: float, f: Fitted) -> float:
    """By how much a law, fitted to the levels, is further from them than noise makes the truth."""
    read = replace(problem, step=step)
    return fit(read, f, steps=EFFORT.fine, from_here=True).chi2 - read.expected


RINGING = ActiveEffect("resonance", "sensor", {"share": 0.25, "period": 0.19, "damping": 0.06})


def with_a_law(problem: Problem, name: str) -> Fitted:
    """The lowest fit of a term from any of its starts."""
    start = nothing(problem)
    terms = [t for t in all_terms(problem, start.residuals) if t.name == name]
    tried = [replace(start, terms=(t,), values=(values,)) for t in terms for values in t.starts]
    return fit(problem, min((evaluated(problem, f) for f in tried), key=lambda f: f.chi2))


@pytest.mark.parametrize("effects", [(RINGING,), ()], ids=["rings too", "is healthy"])
@pytest.mark.parametrize("name", ["resonance", "deadband", "hysteresis"])
def test_only_a_law_that_is_there_passes_from_level_to_level_when_the_recordings_do(effects, name):
    problem = read_in_steps(effects, np.round)
    start, law = nothing(problem), with_a_law(problem, name)
    assert law.chi2 < start.chi2
    beyond = off(problem, STEP, law)
    if effects and name == "resonance":
        assert beyond < 0.01 * off(problem, STEP, start)
    elif effects:
        assert beyond > 0.95 * off(problem, STEP, start)
    else:
        assert abs(beyond - off(problem, STEP, start)) < 0.2 * replace(problem, step=STEP).expected


@pytest.mark.parametrize("effects", [(RINGING,), ()], ids=["rings too", "is healthy"])
def test_noise_puts_the_truth_as_far_off_the_levels_as_it_is_said_to(effects):
    """On average over steps: in a single one the output may rest near the end of a level, or far from it."""
    beyond = []
    for step in (3.0, 3.3, 3.7, 4.0, 4.4, 5.0, 6.0):
        problem = read_in_steps(effects, np.round, step)
        truth = with_a_law(problem, "resonance") if effects else nothing(problem)
        beyond.append(off(problem, step, truth) / replace(problem, step=step).expected)
    assert abs(np.mean(beyond)) < 0.2
    assert np.max(np.abs(beyond)) < 0.5
