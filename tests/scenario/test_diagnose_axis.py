"""On a plant that integrates, what is missing adds up; it is found all the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.events.tone import tone
from hil.diagnosis.intake.check import check
from hil.diagnosis.intake.problem import Problem, pose
from hil.diagnosis.search.fits import fit, with_known_start
from hil.diagnosis.search.fitted import Fitted, nothing, output_of
from hil.diagnosis.search.terms import all_terms
from hil.diagnosis.verdict.choice import Choice
from hil.diagnosis.verdict.explain import explained
from hil.errors import FileError
from hil.identification.preparation.experiment import Experiment, experiment
from hil.physics.compose import plant
from hil.physics.model import Model, Noise, typical_model
from hil.physics.simulate import ActiveEffect, Drive, simulate
from hil.record.recording import recording

RATE_HZ, NOISE_M = 250.0, 2e-5
AXIS = plant("linear-axis")


def moved(kind: int, *effects: ActiveEffect, humming_n: float = 0.0) -> Experiment:
    """A carriage of 100 kg pushed to and fro for 16 s, and shaken by what has a phase of its own in each run."""
    rng = np.random.default_rng(kind)
    time_s = np.arange(0.0, 16.0, 1.0 / RATE_HZ)
    slow, fast = ((0.3, 1.7), (0.5, 2.9), (0.2, 4.1))[kind]
    force = 250.0 * np.sin(2.0 * np.pi * slow * time_s) + 120.0 * np.sin(2.0 * np.pi * fast * time_s)
    shaken = force + humming_n * np.sin(2.0 * np.pi * 2.3 * time_s + 2.0 * kind)
    position = simulate(AXIS, AXIS.typical, Drive(shaken[None, :], 0.0, 1.0 / RATE_HZ), effects, factor=4.0)[0]
    measured = position + NOISE_M * rng.standard_normal(len(time_s))
    return experiment(recording(f"run-{kind}", time_s, {"force [N]": force, "position [m]": measured}), AXIS)


def answer(*effects: ActiveEffect) -> Choice:
    return explained(pose(MODEL, [moved(kind, *effects) for kind in range(3)]))[1]


def fitted(problem: Problem, *effects: ActiveEffect) -> Fitted:
    """An explanation as it is where nothing has been fitted yet."""
    start = nothing(problem)
    known = {(term.name, term.hook): term for term in all_terms(problem, start.residuals)}
    terms = tuple(known[effect.key] for effect in effects)
    values = tuple(tuple(effect.parameters[u.name] for u in known[effect.key].unknowns) for effect in effects)
    return replace(start, terms=terms, values=values)


MODEL: Model = replace(typical_model("linear-axis"), noise=Noise(NOISE_M))
FRICTION = ActiveEffect("friction", "force", {"coulomb": 9.0, "stiction": 1.3, "stribeck": 0.02, "presliding": 1e-4})
LIMITED = ActiveEffect("saturation", "coil", {"limit": 280.0, "knee": 0.05, "slope": 0.0})
UNEVEN = ActiveEffect("asymmetry", "command", {"ratio": 0.97, "gain": 1.0})
DRAGGING = ActiveEffect("uneven_drag", "drag", {"difference": 0.2})


@pytest.mark.parametrize("effects", [(FRICTION,), (LIMITED, UNEVEN)], ids=lambda e: " and ".join(x.name for x in e))
def test_its_causes_are_found(effects):
    of = answer(*effects)
    assert of.verdict == "explained"
    assert sorted(of.chosen.names) == sorted(effect.name for effect in effects)
    assert of.chosen.chi2 < 1.05 * len(of.chosen.residuals)


def test_a_guide_that_brakes_one_way_harder_is_told_beside_its_friction():
    of = answer(FRICTION, DRAGGING)
    assert of.verdict == "explained"
    assert sorted(of.chosen.names) == ["asymmetry", "friction"]
    told = {(term.name, term.hook): values for term, values in zip(of.chosen.terms, of.chosen.values, strict=True)}
    assert told["uneven_drag", "drag"] == pytest.approx((0.2,), abs=0.01)


def raw_rms(problem: Problem, f: Fitted) -> float:
    """Of simulations that run freely from where the first reading says, in units of the noise."""
    pairs = zip(problem.experiments, problem.noises, strict=True)
    return float(np.sqrt(np.mean([np.mean(((output_of(problem, f, e) - e.output) / n.std) ** 2) for e, n in pairs])))


def test_a_start_does_not_bend_to_laws_that_are_off_by_much_more_than_noise():
    """A tone that is no part of the explanation; without friction in it, a start of a few noises would hide some."""
    problem = pose(MODEL, [moved(0, FRICTION, humming_n=20.0)])
    bent = fit(problem, fitted(problem, FRICTION))
    known = with_known_start(problem, bent)
    assert raw_rms(problem, known) < raw_rms(problem, bent) - 1.0
    assert known.chi2 >= bent.chi2
    within_noise = pose(MODEL, [moved(0, FRICTION)])
    exact = fit(within_noise, fitted(within_noise, FRICTION))
    assert with_known_start(within_noise, exact) is exact


@pytest.mark.parametrize("factor", [1000.0, 100.0, 0.1])
def test_a_wrong_unit_is_refused_though_free_simulations_fit_nothing(factor):
    e = moved(0, ActiveEffect("load_force", "force", {"force": 3.0}))
    scaled = replace(e, output=factor * e.output, drive=replace(e.drive, first_output=factor * e.drive.first_output))
    with pytest.raises(FileError, match=rf"'force \[N\]'.* by {factor:g};.* with 'position \[m\]' divided"):
        check(MODEL, [scaled])


def test_swapped_columns_are_refused_though_free_simulations_fit_nothing():
    e = moved(0, ActiveEffect("load_force", "force", {"force": 3.0}))
    force, position = e.drive.inputs[0], e.output
    turned = recording("turned", e.time_s, {"force [N]": position, "position [m]": force})
    with pytest.raises(FileError, match="look swapped"):
        check(MODEL, [experiment(turned, AXIS)])


def test_a_tone_that_enters_as_a_force_is_told_beside_its_start():
    problem = pose(MODEL, [moved(kind, humming_n=3.0) for kind in range(3)])
    events = tone(problem, nothing(problem))
    assert events is not None
    assert events.name == "periodic_disturbance"
    assert events.values["frequency"][0] == pytest.approx(2.3, abs=0.005)


def test_a_healthy_one_is_consistent():
    assert answer().verdict == "consistent"


RINGING = ActiveEffect("resonance", "sensor", {"share": 0.45, "period": 0.07, "damping": 0.08})
LATE = ActiveEffect("dead_time", "sensor", {"delay": 0.006})


@pytest.mark.parametrize(
    "effects", [(RINGING,), (LATE,), ()], ids=lambda e: " and ".join(x.name for x in e) or "healthy"
)
def test_a_law_that_a_coarse_channel_hides_is_told_by_its_levels(effects):
    step_m = 0.001
    fine = replace(MODEL, origin={"resolution": 1e-7})
    made = [moved(kind, *effects) for kind in range(3)]
    of = diagnose(fine, [replace(e, output=step_m * np.rint(e.output / step_m)) for e in made]).diagnosis
    assert [found.name for found in of.effects] == ["quantisation", *(effect.name for effect in effects)]
    assert of.verdict == "explained"
