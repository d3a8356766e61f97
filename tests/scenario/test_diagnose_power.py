"""An agreement means something where the recordings could have shown a difference, and nothing where they could not."""

from __future__ import annotations

import numpy as np

from hil.diagnosis.diagnosis import Diagnosis
from hil.physics.compose import plant
from tests.answers import answer
from tests.concealed import NOISE, PLANT, RATE_HZ, diagnosed


def of_a_healthy_unit(top: float, duration_s: float = 5.6) -> Diagnosis:
    """One step up and back, which ends where the half begins that is judged, less what the plant remembers."""
    time_s = np.arange(0.0, duration_s, 1.0 / RATE_HZ)
    command = top * ((time_s > 0.464 * duration_s) & (time_s < 0.553 * duration_s))
    noise = NOISE * np.random.default_rng(3).standard_normal(len(command))
    one = answer(plant(PLANT), command, 1.0 / RATE_HZ, noise=noise, factor=4.0)
    return diagnosed([one]).diagnosis


def test_a_part_kept_back_that_holds_only_a_rest_does_not_undo_what_the_other_shows():
    of = of_a_healthy_unit(40.0)
    assert of.verdict == "consistent" and "Nothing can be said" not in of.headline
    assert of.held_out.ceiling < 20.0  # of what is kept back


def test_an_agreement_beneath_the_noise_means_nothing_and_says_so():
    of = of_a_healthy_unit(21.0)  # just out of the dead band
    assert of.verdict == "consistent" and of.headline.startswith("This unit cannot be judged: noise allows a fit")
