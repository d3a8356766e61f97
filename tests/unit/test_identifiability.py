"""Parameters that recordings tell only together: what is known of them, and what of it can be seen to change."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
import pytest

from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.intake.problem import pose
from hil.identification.grey_box.estimate import Unknown, estimate
from hil.identification.grey_box.identify import GreyBoxFit, _wider_than_themselves, fit_plant
from hil.identification.preparation.experiment import Experiment
from hil.physics.compose import plant
from hil.physics.model import typical_model
from hil.physics.simulate import Drive, simulate
from hil.record.recording import Array, recording
from tests.concealed import bound

pytestmark = pytest.mark.xdist_group("moves of a cylinder")  # on one worker: it is fitted once

TYPICAL = typical_model("hydraforce-sp08-47c")


def test_directions_that_no_sample_tells_are_told_from_those_that_samples_do():
    unknowns = [Unknown(name, "1", 1.0, 0.0, 5.0, 1.0) for name in "abc"]
    noise = np.random.default_rng(1).normal(size=500)

    def residuals(values):
        a, b, c = values
        left: Array = 20.0 * (a + b - 2.0) + 30.0 * np.linspace(-1.0, 1.0, 500) * (c - 1.0) + noise
        return left

    found = estimate(residuals, unknowns)
    assert np.isinf(found.std[:2]).all()
    assert found.std[2] == pytest.approx(1.0 / 30.0 / np.sqrt(500 / 3.0), rel=0.2)
    assert found.identifiability.is_shared_beyond_noise.tolist() == [True, True, False]
    assert np.abs(found.identifiability.unidentifiable) == pytest.approx(
        np.array([[5.0, 5.0, 0.0]]) / np.sqrt(12.0), abs=1e-3
    )
    both = np.array([1.0, 1.0, 0.0])
    assert np.sqrt(both @ found.identifiability.whole @ both) == pytest.approx(1.0 / 20.0 / np.sqrt(500), rel=0.2)


def small_moves(seed: int, changed: Mapping[str, float]) -> Experiment:
    """A position loop whose valve never opens fully: its gain and the cylinder's speed act as one."""
    values = {**TYPICAL.values, **{name: share * TYPICAL.values[name] for name, share in changed.items()}}
    time_s = np.arange(0.0, 20.0, 0.005)
    request = 40.0 + 8.0 * np.sin(1.1 * time_s) + 6.0 * np.sign(np.sin(0.9 * time_s))
    drive = Drive(request[None, :], float(request[0]), 0.005)
    position = simulate(TYPICAL.definition, values, drive)[0] + np.random.default_rng(seed).normal(0.0, 0.05, 4000)
    (made,) = bound(TYPICAL, [recording(f"moves-{seed}", time_s, {"request [mm]": request, "position [mm]": position})])
    return made


@cache
def identified() -> GreyBoxFit:
    return fit_plant(TYPICAL, [small_moves(1, {}), small_moves(2, {})])


def test_the_model_knows_what_they_are_together():
    assert any(note.startswith("confounded: loop_gain, speed_extend") for note in identified().notes)
    assert "not identifiable" in identified().summary()
    problem = pose(identified().model, [small_moves(3, {})])
    prior = problem.prior
    assert prior.confounded_with("loop_gain") == ["speed_extend"]
    assert prior.confounded_with("speed_ratio") == []
    names, values = [p.name for p in problem.base], problem.model.values
    gain, speed = names.index("loop_gain"), names.index("speed_extend")
    product = np.zeros(len(names))  # slope of the logarithm of loop gain times speed
    product[[gain, speed]] = 1.0 / values["loop_gain"], 1.0 / values["speed_extend"]
    assert np.sqrt(product @ prior.covariance @ product) < 0.02
    assert prior.std[gain] > values["loop_gain"]
    slower = {**values, "speed_extend": 0.98 * values["speed_extend"]}
    assert prior.was("loop_gain", slower) == pytest.approx(values["loop_gain"] / 0.98, rel=2e-3)
    given = prior.of([k for k in range(len(names)) if k != gain])
    assert np.sqrt(given[speed - 1, speed - 1]) < 0.02 * values["speed_extend"]


@pytest.mark.parametrize("changed", [{"loop_gain": 0.8}, {"speed_extend": 0.85, "spool_frequency": 0.7}, {}])
def test_a_unit_that_changed_in_what_they_are_together_has_changed(changed):
    told = diagnose(identified().model, [small_moves(5, changed), small_moves(6, changed)]).diagnosis
    assert told.verdict == ("parameter_change" if changed else "consistent")
    assert told.effects == ()
    ratios = {c.name: c.after / c.before for c in told.changed_parameters}
    product = ratios.pop("loop_gain", 1.0) * ratios.pop("speed_extend", 1.0)
    assert product == pytest.approx(changed.get("loop_gain", 1.0) * changed.get("speed_extend", 1.0), rel=0.02)
    assert set(ratios) == set(changed) - {"loop_gain", "speed_extend"}
    assert any("hich of them has changed is open" in text for text in told.warnings) is bool(changed)
    assert all(fit.corrected > fit.ceiling - 0.1 for fit in told.recordings.values())


def test_an_interval_wider_than_its_value_is_none():
    hpv41 = plant("brevini-hpv41")
    values = {p.name: p.typical for p in hpv41.parameters}
    stds = {name: 0.1 * abs(value) for name, value in values.items()} | {"dead_time": 0.6 * values["dead_time"]}
    assert _wider_than_themselves(hpv41, values, stds) == ("dead_time",)
    assert _wider_than_themselves(hpv41, values | {"dead_time": 1.3 * values["dead_time"]}, stds) == ()
    # a value near nothing is told where it is known well beside what is usual
    assert _wider_than_themselves(hpv41, values | {"dead_band": 0.0}, {"dead_band": 0.1}) == ()


def test_one_thing_is_said_of_a_parameter_that_no_recording_tells():
    drives, rng = typical_model("coupled-drives"), np.random.default_rng(2)
    columns = {
        "drive voltage [V]": np.repeat(rng.choice([-0.5, 0.5], 60), 5),
        "pulley speed [V]": 0.3 * np.abs(rng.normal(size=300)),  # which no command drives
    }
    found = fit_plant(drives, bound(drives, [recording("noise", 0.02 * np.arange(300.0), columns)]))
    assert set(found.on_bound) == {p.name for p in drives.definition.parameters if not p.fixed}
    for name in found.on_bound:
        std = found.model.parameters[name].std
        (said,) = [note for note in found.notes if name in note]
        assert ("not identifiable" in said) is (std == np.inf) is not ("ended on a bound" in said)
