"""The pneumatic cylinder under test, with the friction of its seal at two pressures."""

import numpy as np

from hil.identification.grey_box.identify import fit_plant, starting_model
from hil.identification.preparation.experiment import experiment
from hil.physics.compose import plant
from hil.physics.simulate import ActiveEffect, Drive, simulate
from hil.record.recording import recording

CYLINDER = plant("pneumatic-cylinder")
TRUE = {"share": 0.02, "constant": 1.0, "presliding": 0.4}


def force(displacement, pressure_bar):
    """Force over an imposed motion."""
    inputs = np.vstack([displacement, np.full(len(displacement), pressure_bar)])
    seal = ActiveEffect("seal_friction", "seal", TRUE)
    return simulate(CYLINDER, CYLINDER.typical, Drive(inputs, np.nan, 0.01, read_at=1.0), [seal])[0]


def test_the_loop_opens_with_pressure_and_builds_up_over_the_travel():
    travel = np.concatenate([np.linspace(0.0, 10.0, 500), np.linspace(10.0, 0.0, 500)])
    for pressure in (1.0, 6.0):
        found = force(travel, pressure)
        pressed = 0.1 * CYLINDER.typical["piston_area"] * pressure
        assert np.isclose(found[499] - pressed, 1.0 + 0.02 * pressed, rtol=1e-6)
        assert np.isclose(found[-1] - pressed, -(1.0 + 0.02 * pressed), rtol=1e-6)
        after = 500 + int(np.argmin(np.abs(10.0 - travel[500:] - 0.4 * np.log(2.0))))  # half way to the other side
        assert abs(found[after] - pressed) < 0.06 * (1.0 + 0.02 * pressed)


def test_the_force_does_not_depend_on_how_the_travel_is_sampled():
    fine = np.interp(np.arange(4000) / 4.0, np.arange(1000), 5.0 * np.sin(np.arange(1000) / 60.0))
    fine = np.maximum.accumulate(fine)  # one way, so that no turning point falls between samples
    assert np.allclose(force(fine, 3.0)[::4], force(fine[::4], 3.0), rtol=1e-12)


def test_uneven_stamps_are_kept():
    generator = np.random.default_rng(2)
    time_s = np.cumsum(generator.uniform(0.009, 0.012, 2000))
    travel = 20.0 + 18.0 * np.sin(time_s)
    pressure = 3.0 + 0.5 * np.sin(0.37 * time_s)
    columns = {"displacement [mm]": travel, "pressure [bar]": pressure, "force [N]": 49.0 * pressure + 2.0}
    bound = experiment(recording("uneven", time_s, columns), CYLINDER)
    assert bound.grid_s is not None
    assert np.array_equal(bound.time_s, time_s)
    found = fit_plant(starting_model("pneumatic-cylinder"), [bound]).model.values
    assert abs(found["piston_area"] - 490.0) < 1.0
    assert abs(found["preload"] - 2.0) < 0.5
