"""A recording that was cut out of a longer one begins where the unit still moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.identification.grey_box.compare import compare
from hil.identification.grey_box.identify import fit_plant
from hil.identification.preparation.experiment import experiment
from hil.physics.model import Model, ModelEffect, Value, typical_model
from hil.physics.simulate import Drive, simulate
from hil.record.recording import Recording, recording
from tests.concealed import NOISE, bound, intake, nominal, records, with_rows

INTERVAL_S = 0.01


def second_order(**values: float) -> Model:
    model = typical_model("transfer-function")
    given = {name: replace(model.parameters[name], value=value) for name, value in values.items()}
    return replace(model, parameters={**model.parameters, **given}, input="u [V]", output="y [bar]")


def recorded(model: Model, seed: int) -> Recording:
    """Steps and what the model makes of them with noise, over 40 s."""
    rng = np.random.default_rng(seed)
    command = np.repeat(rng.uniform(-5.0, 5.0, 27), 150)[:4000]
    output = simulate(model.definition, model.values, Drive(command[None, :], 0.0, INTERVAL_S))[0]
    made = output + 0.02 * rng.standard_normal(len(output))
    return recording("cut", INTERVAL_S * np.arange(float(len(output))), {"u [V]": command, "y [bar]": made})


@pytest.mark.parametrize(
    "values",
    [
        {"gain": 2.0, "lag_time": 8.0},
        {"gain": 2.0, "pair1_time": 0.2, "pair1_damping": 0.03},
        {"gain": 1.2, "pair1_time": 1.4, "pair1_damping": 1.06, "pair1_zero": -1.5, "dead_time": 0.2},
    ],
)
def test_the_true_model_fits_what_was_cut_out_of_a_longer_recording(values):
    model = second_order(**values)
    for seed in range(3):
        whole = recorded(model, seed)
        cut = whole.rows(2020, 1900)
        found = compare(model, experiment(cut, model.definition, "u", "y"))
        assert found.fit is not None and found.ceiling is not None
        assert found.rms_error < 1.05 * 0.02
        assert any("begins in motion" in note and "begun at rest the fit is" in note for note in found.notes)
        assert not compare(model, experiment(whole, model.definition, "u", "y")).notes


@pytest.mark.parametrize("seed", [9, 11])
def test_a_sensor_that_is_blind_to_the_direction_may_have_run_either_way(seed):
    typical, blind = typical_model("coupled-drives"), ModelEffect("blind_to_sign", "pickup", {"share": Value(1.0, "1")})
    values = {"gain": 1.17, "motor_lag": 0.124, "spring_frequency": 20.9, "spring_damping": 0.099, "count_time": 0.012}
    known = {name: replace(typical.parameters[name], value=value) for name, value in values.items()}
    model = replace(
        typical, effects=(blind,), parameters={**typical.parameters, **known}, input="u [V]", output="y [V]"
    )
    command = np.repeat(np.random.default_rng(seed).choice([-0.5, 0.5], 100), 5)
    drive = Drive(command[None, :], 0.0, 0.02)
    output = simulate(model.definition, model.values, drive, model.active_effects)[0]
    read = output + 0.045 * np.random.default_rng(6).standard_normal(500)
    cut = recording("blind", 0.02 * np.arange(500.0), {"u [V]": command, "y [V]": read}).rows(300, 200)
    assert compare(model, experiment(cut, model.definition, "u", "y")).rms_error < 1.1 * 0.045


def test_a_valve_that_is_cut_in_a_step_fits_and_one_that_rests_is_left_as_it_is():
    model, notes = nominal(), list[str]()
    for each in records(seed=51):
        (whole,) = bound(model, [each])
        assert not compare(model, whole).notes
        (cut,) = bound(model, [with_rows(each, slice(len(each) // 3 + 7, None))])
        found = compare(model, cut)
        notes += found.notes
        assert found.rms_error < 1.05 * NOISE
    assert any("begins in motion" in note for note in notes)


def test_a_gain_that_is_wrong_is_not_taken_for_a_start_in_motion():
    model = second_order(gain=2.0, lag_time=0.3)
    other = replace(model, parameters={**model.parameters, "gain": replace(model.parameters["gain"], value=2.2)})
    assert not compare(other, experiment(recorded(model, 1), model.definition, "u", "y")).notes


def test_what_was_cut_out_of_a_longer_recording_is_identified_as_what_it_is():
    model = second_order(gain=1.2, pair1_time=1.4, pair1_damping=1.06, pair1_zero=-1.5)
    cut = recorded(model, 2).rows(2020, 1900)  # its first 10 s answer to what went before
    typical = replace(typical_model("transfer-function"), input="u", output="y")
    found = fit_plant(typical, [experiment(cut, typical.definition, "u", "y")])
    assert any("begins in motion" in note for note in found.notes)
    assert min(found.fits.values()) > 98.0
    for name in ("gain", "pair1_time", "pair1_zero"):
        assert found.model.values[name] == pytest.approx(model.values[name], rel=0.02)


def test_a_tank_that_cools_where_its_recording_begins_is_no_integrator():
    rng = np.random.default_rng(3)
    model = second_order(gain=8.0, offset=20.0, pair1_time=122.0, pair1_damping=2.56)
    command = np.repeat(rng.uniform(0.0, 100.0, 60), 50)
    output = simulate(model.definition, model.values, Drive(command[None, :], 0.0, 2.0))[0]
    whole = recording(
        "tank", 2.0 * np.arange(3000.0), {"u [%]": command, "y [bar]": output + rng.normal(0.0, 0.1, 3000)}
    )
    typical = replace(typical_model("transfer-function"), input="u", output="y")
    found = fit_plant(typical, [experiment(whole.rows(1500, 1500), typical.definition, "u", "y")])
    assert found.model.values["integrator_gain"] == 0.0
    assert found.model.values["gain"] == pytest.approx(8.0, rel=0.1)
    assert min(found.fits.values()) > 85.0


def test_a_healthy_unit_that_is_cut_in_a_step_is_checked_without_a_mismatch():
    each = records(seed=52)[0]
    checked = intake([with_rows(each, slice(len(each) // 3 + 7, None))])
    (e,) = checked.experiments
    model = nominal()
    assert np.std((e.output - e.respond(model.definition, model.values)[0])[e.valid]) < 1.05 * NOISE
