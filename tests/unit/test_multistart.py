"""A fit that begins in the wrong place ends in the right one."""

import numpy as np

from hil.identification.grey_box.free import unknown_of
from hil.identification.grey_box.identify import fit_plant
from hil.identification.grey_box.multistart import far_places
from hil.identification.preparation.experiment import experiment
from hil.physics.compose import plant
from hil.physics.model import typical_model
from tests.answers import answer

FLAP = plant("throttle-flap")


def test_a_unit_far_from_the_usual_one_is_identified():
    truth = {"gain": -0.7, "frequency": 2.0, "damping": 0.2, "rest": 9.0}
    time_s = np.arange(0.0, 15.0, 0.02)
    command = 20.0 * np.sign(np.sin(2.0 * np.pi * 0.17 * time_s)) + 8.0 * np.sin(2.0 * np.pi * 0.6 * time_s)
    noise = 0.02 * np.random.default_rng(5).standard_normal(len(command))
    far = answer(FLAP, command, 0.02, noise=noise, start=9.0, **truth)
    found = fit_plant(typical_model(FLAP.name), [experiment(far, FLAP)])
    assert min(found.fits.values()) > 99.0
    assert abs(found.model.values["frequency"] - 2.0) < 0.01


def test_places_are_within_bounds_and_the_same_again():
    unknowns = [unknown_of(typical_model(FLAP.name), p.name) for p in FLAP.parameters]
    places = far_places(unknowns, 16)
    assert np.array_equal(places, far_places(unknowns, 16))
    for u, values in zip(unknowns, np.array(places).T, strict=True):
        assert u.low <= values.min() < values.max() <= u.high
