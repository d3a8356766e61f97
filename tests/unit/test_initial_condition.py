"""What the first reading of an integrating plant got wrong is not taken for physics; hum that was there is no news."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hil.diagnosis.intake.problem import pose
from hil.diagnosis.verdict.explain import explained
from hil.identification.grey_box.identify import fit_plant
from hil.identification.grey_box.lines import common_line, line_at
from hil.identification.preparation.experiment import Experiment, experiment
from hil.identification.preparation.initial_condition import start_slope, with_free_start
from hil.physics.compose import plant
from hil.physics.model import Model, Noise, typical_model
from hil.record.recording import recording
from tests.answers import answer

RATE_HZ, NOISE_M = 250.0, 2e-5
AXIS = plant("linear-axis")


def axis(seed: int, hum_m: float = 0.0) -> Experiment:
    """A carriage pushed to and fro, its position read with noise, and with hum of another phase each time."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(0.0, 12.0, 1.0 / RATE_HZ)
    force = 100.0 * np.sign(np.sin(2.0 * np.pi * 0.5 * time_s)) + 40.0 * np.sin(2.0 * np.pi * 2.0 * time_s)
    hum = hum_m * np.sin(2.0 * np.pi * 47.3 * time_s + rng.uniform(0.0, 6.0))
    noise = hum + NOISE_M * rng.standard_normal(len(time_s))
    truth = {"mass": 100.0, "viscous": 200.0}
    made = answer(AXIS, force, 1.0 / RATE_HZ, noise=noise, name=f"run-{seed}", factor=4.0, **truth)
    return experiment(made, AXIS)


def healthy(hum_m: float = 0.0) -> Model:
    return fit_plant(typical_model("linear-axis"), [axis(seed, hum_m) for seed in (1, 2)]).model


def test_parameters_of_an_integrating_plant_are_those_of_the_truth():
    found = healthy().parameters
    for name, true in (("mass", 100.0), ("viscous", 200.0)):
        std = found[name].std
        assert std is not None and abs(found[name].value - true) < 4.0 * std + 1e-4 * true


def test_a_free_start_takes_an_offset_and_nothing_else():
    e = axis(1)
    slope = start_slope(e, AXIS, AXIS.typical, (), NOISE_M)
    assert slope is not None and np.allclose(slope, slope[0])  # a carriage keeps for good what its start got wrong
    shape = np.sin(np.arange(len(slope)) * 2.0 * np.pi / 250.0)
    left = with_free_start(5.0 + shape, slope)
    assert np.allclose(left, shape, atol=0.02)
    offset = with_free_start(np.full(len(slope), 5.0), slope)
    power = float(slope @ slope)
    assert np.isclose(offset @ offset, 25.0 * len(slope) / (1.0 + power))  # the marginal likelihood, exactly


def test_samples_that_say_nothing_do_not_say_where_a_plant_started():
    e = axis(1)
    held = e.without(np.arange(len(e.output)) % 500 > 350)
    other = replace(held, output=np.where(held.valid, held.output, held.output + 0.1))
    model = replace(typical_model("linear-axis"), noise=Noise(NOISE_M))
    left = [pose(model, [each]).nominal_residuals for each in (held, other)]
    assert np.allclose(left[0], left[1], rtol=1e-6)


def started(force: np.ndarray, position: np.ndarray) -> float:
    time_s = np.arange(len(force)) / RATE_HZ
    made = recording("run", time_s, {"force [N]": force, "position [m]": position})
    return experiment(made, AXIS).drive.first_output


def test_a_recording_that_begins_at_rest_starts_at_the_mean_of_the_rest():
    noise = NOISE_M * np.random.default_rng(3).standard_normal(2000)
    force = np.where(np.arange(2000) < 1000, 5.0, 20.0)  # it stands against a stop
    start = started(force, 0.3 + noise)
    assert start == np.mean(0.3 + noise[:1000])
    assert abs(start - 0.3) < 4.0 * NOISE_M / np.sqrt(1000.0)


def test_a_recording_that_begins_in_motion_starts_near_its_first_reading():
    time_s = np.arange(2000) / RATE_HZ
    noise = NOISE_M * np.random.default_rng(4).standard_normal(2000)
    start = started(np.full(2000, 5.0) + (time_s > 4.0), 0.05 * time_s + noise)
    assert abs(start) < 20.0 * NOISE_M  # 50 mm after a second are 2500 times the noise


def test_a_command_that_moves_at_once_leaves_the_first_reading():
    position = NOISE_M * np.random.default_rng(5).standard_normal(200)
    assert started(np.sin(np.arange(200) / 9.0), position) == position[0]


def test_a_plant_that_does_not_start_from_its_reading_has_no_free_start():
    valve = plant("brevini-hpv41")
    time_s = np.arange(0.0, 2.0, 0.004)
    command = 50.0 * np.sign(np.sin(2.0 * np.pi * time_s))
    made = recording("valve", time_s, {"command [%]": command, "flow [l/min]": np.zeros(len(time_s))})
    assert start_slope(experiment(made, valve), valve, valve.typical, (), 0.3) is None
    residuals = np.ones(5)
    assert with_free_start(residuals, None) is residuals


def test_a_healthy_axis_is_consistent_whatever_its_first_reading():
    assert explained(pose(healthy(), [axis(seed) for seed in (11, 12)]))[1].verdict == "consistent"


def test_hum_that_the_healthy_unit_had_is_no_news_and_more_of_it_is():
    model = healthy(hum_m=2.0 * NOISE_M)
    assert model.noise is not None and model.noise.hum_hz is not None
    assert abs(model.noise.hum_hz - 47.3) < 0.1
    assert np.isclose(model.noise.hum, 2.0 * NOISE_M, rtol=0.1)
    assert abs(model.noise.std / NOISE_M - 1.0) < 0.1
    same = pose(model, [axis(seed, 2.0 * NOISE_M) for seed in (21, 22)])
    assert explained(same)[1].verdict == "consistent"
    _, more = explained(pose(model, [axis(seed, 20.0 * NOISE_M) for seed in (21, 22)]))
    assert [e.name for e in more.events] == ["periodic_disturbance"]


def test_no_line_is_found_in_noise():
    rng = np.random.default_rng(5)
    quiet = [axis(1), axis(2)]
    for _ in range(20):
        noise = [rng.standard_normal(len(e.output)) for e in quiet]
        assert common_line(quiet, noise) is None
    time_s = quiet[0].time_s
    tone, amplitude = line_at(time_s, 3.0 * np.sin(2.0 * np.pi * 31.04 * time_s + 1.0), 31.0)
    assert np.isclose(amplitude, 3.0, rtol=1e-3)
    assert np.allclose(tone, 3.0 * np.sin(2.0 * np.pi * 31.04 * time_s + 1.0), atol=0.02)
