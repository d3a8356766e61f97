"""A model identified without its main law is bent to what it lacks: its own recordings still show the law."""

from __future__ import annotations

import numpy as np
import pytest

from hil.diagnosis.diagnose import Diagnosed, diagnose
from hil.identification.grey_box.identify import fit_plant, starting_model
from hil.identification.preparation.experiment import Experiment, experiment
from hil.identification.uncertainty.fit import fit_percent
from hil.physics.compose import plant
from hil.physics.model import Model
from hil.physics.simulate import ActiveEffect, Drive, simulate
from hil.record.recording import Array, recording


def recorded(name: str, command: Array, interval_s: float, truth: dict[str, float], effect: ActiveEffect) -> Experiment:
    of = plant(name)
    read = simulate(of, of.typical | truth, Drive(command[None, :], 0.0, interval_s), [effect], factor=4.0)[0]
    read = read + 0.005 * np.ptp(read) * np.random.default_rng(len(read)).standard_normal(len(read))
    channels = {s.heading: v for s, v in ((of.inputs[0], command), (of.output, read))}
    return experiment(recording(name, interval_s * np.arange(float(len(read))), channels), of)


def answered(e: Experiment, name: str) -> tuple[Model, Diagnosed]:
    nominal = fit_plant(starting_model(name), [e]).model
    return nominal, diagnose(nominal, [e])


def fit(model: Model, e: Experiment) -> float:
    return fit_percent(e.output, e.respond(model.definition, model.values, model.active_effects)[0])


def drives(seed: int) -> Experiment:
    """A counter of pulses reads the size of a speed that often changes its direction."""
    levels = np.random.default_rng(seed).choice([-1.5, -0.8, 0.8, 1.5], 24)
    truth = {"gain": 3.0, "motor_lag": 0.14, "spring_frequency": 21.0, "spring_damping": 0.12}
    return recorded(
        "coupled-drives", np.repeat(levels, 25), 0.02, truth, ActiveEffect("blind_to_sign", "pickup", {"share": 1.0})
    )


def test_a_model_that_explains_nothing_is_started_from_anywhere():
    nominal, found = answered(drives(seed=3), "coupled-drives")
    unseen = drives(seed=4)
    assert fit(nominal, unseen) < 30.0
    assert [e.name for e in found.diagnosis.effects] == ["blind_to_sign"]
    assert found.diagnosis.corrected_is == "named"
    assert fit(found.corrected, unseen) > 90.0
    for name, value in {"gain": 3.0, "motor_lag": 0.14, "spring_frequency": 21.0}.items():
        assert found.corrected.values[name] == pytest.approx(value, rel=0.05)


@pytest.mark.parametrize("seed", [5, 6])
def test_a_model_that_explains_nothing_does_not_tell_what_was_before_the_recording(seed):
    """Commands before it took what the model lacked: its first 12 s of 12 were said to answer to them."""
    found = fit_plant(starting_model("coupled-drives"), [drives(seed)])
    assert not [note for note in found.notes if "begins in motion" in note]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_law_whose_strength_may_have_either_sign_is_found_with_the_signs_of_the_bench(sign):
    time_s = np.arange(0.0, 10.0, 0.005)
    gap = 2.0 * np.sin(2.0 * np.pi * 0.7 * time_s) + np.sin(2.0 * np.pi * 1.9 * time_s)
    yielding = ActiveEffect("yielding", "field", {"strength": 20.0 * sign, "give": 0.1})
    e = recorded("mr-damper", gap, 0.005, {"viscous": 2.0 * sign, "spring": 0.0, "zero": 0.0}, yielding)
    _, found = answered(e, "mr-damper")
    (effect,) = found.diagnosis.effects
    assert effect.name == "hysteresis"
    assert effect.parameters["strength"].value == pytest.approx(20.0 * sign, rel=0.1)
