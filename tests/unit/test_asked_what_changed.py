"""A model that lacks something itself: later recordings of a unit that is as it was are no news."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.as_before import as_before, is_asked_what_changed, with_inner_noise
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.problem import Problem, pose
from hil.identification.experiment import experiment
from hil.identification.grey_box import fit_plant
from hil.physics.compose import plant
from hil.physics.model import Model, typical_model
from hil.physics.simulate import ActiveEffect, Drive, simulate
from hil.record.recording import Recording, recording

FLAP = plant("throttle-flap")
TIME_S = np.arange(0.0, 20.0, 0.02)


def recorded(name: str, coulomb: float, seed: int) -> Recording:
    rng = np.random.default_rng(seed)
    command = np.repeat(rng.uniform(-15.0, 15.0, 40), len(TIME_S) // 40)
    friction = ActiveEffect(
        "friction", "force", {"coulomb": coulomb, "stiction": 1.2, "stribeck": 0.5, "presliding": 0.01}
    )
    angle = simulate(FLAP, FLAP.typical, Drive(command[None, :], 2.5, 0.02), [friction])[0]
    angle = angle + 0.003 * rng.standard_normal(len(angle))
    return recording(name, TIME_S, {"motor command [V]": command, "flap angle [V]": angle})


@pytest.fixture(scope="module")
def lacking() -> Model:
    """Identified from a unit that sticks, by a plant that does not."""
    return fit_plant(typical_model(FLAP.name), [experiment(recorded(f"first-{k}", 3.0, k), FLAP) for k in (1, 2)]).model


def asked(model: Model, each: Recording) -> Problem:
    return pose(model, [experiment(each, FLAP)])


def test_a_unit_that_still_sticks_as_much_is_as_it_was(lacking: Model) -> None:
    again = asked(lacking, recorded("later", 3.0, 7))
    assert is_asked_what_changed(again)
    assert "as it was when the model was identified" in as_before(again)
    assert not as_before(asked(lacking, recorded("worn", 8.0, 7)))


def test_its_own_recordings_ask_what_the_model_lacks(lacking: Model) -> None:
    assert not is_asked_what_changed(asked(lacking, recorded("first-1", 3.0, 1)))


def test_the_diagnosis_says_so(lacking: Model) -> None:
    later = experiment(recorded("later", 3.0, 7), FLAP)
    said = diagnose(lacking, [later], budget_s=0.0).diagnosis  # what a long search finds is not news either
    assert said.verdict == "consistent"
    assert "as it was" in said.headline
    assert any("what the model itself lacks" in text for text in said.warnings)


def test_inner_signals_are_as_noisy_as_the_model_left_them(lacking: Model) -> None:
    again = replace(asked(lacking, recorded("later", 3.0, 7)), observed_noise=({"spool": 0.1, "supply": 2.0},))
    known = replace(lacking, origin={**lacking.origin, "inner_rms": {"spool": 0.5, "supply": 1.0}})
    assert with_inner_noise(replace(again, model=known)).observed_noise == ({"spool": 0.5, "supply": 2.0},)
