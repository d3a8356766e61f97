"""Poles that the samples themselves show, where a grid of start values misses them."""

import numpy as np
import pytest

from hil.identification.grey_box.identify import fit_plant, starting_model
from hil.identification.grey_box.linear_starts import poles_rad_s
from hil.identification.preparation.experiment import Experiment, experiment
from hil.identification.uncertainty.fit import fit_percent
from hil.physics.compose import plant
from hil.physics.simulate import Drive, simulate
from hil.physics.transfer_function import from_factors
from hil.record.recording import recording

PLANT = plant("transfer-function")
INTERVAL_S = 0.01
# two light resonances with an antiresonance between them, as an arm or a line has
ARM = from_factors(0.4, [(1.2e-4, 1.6e-4), (8e-4, 7.5e-4)], [(2e-4, 3e-4)])


def bound(model, seed: int, count: int = 512) -> Experiment:
    rng = np.random.default_rng(seed)
    command = np.repeat(rng.standard_normal(count // 2), 2)
    output = simulate(PLANT, PLANT.typical | model.to_parameters(), Drive(command[None, :], 0.0, INTERVAL_S))[0]
    noisy = output + 0.01 * np.std(output) * rng.standard_normal(count)
    columns = {"torque [V]": command, "acceleration [V]": noisy}
    return experiment(recording("arm", np.arange(count) * INTERVAL_S, columns), PLANT, "torque", "acceleration")


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_poles_are_those_of_the_unit(count):
    factors = [(0.2,), (0.01, 2.5e-3), (1.2e-4, 1.6e-4)]
    model = from_factors(1.0, {1: factors[:1], 2: factors[1:2], 3: factors[:2], 4: factors[1:]}[count])
    found = poles_rad_s([bound(model, seed=3)], count)
    assert found is not None
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(model.poles), rtol=0.05)


def test_too_few_samples_show_none():
    assert poles_rad_s([bound(ARM, seed=0, count=40)], 4) is None


def test_two_light_resonances_are_identified_and_foretold():
    model = fit_plant(starting_model("transfer-function"), [bound(ARM, seed=0)]).model
    unseen = bound(ARM, seed=1)
    assert fit_percent(unseen.output, unseen.respond(PLANT, model.values)[0]) > 95.0
