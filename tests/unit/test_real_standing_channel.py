"""Real recordings stand still for long: a position held by a cylinder has no white noise to measure."""

import numpy as np

from hil.identify.noise import measured_noise


def test_a_misfit_does_not_pass_for_the_noise_of_a_channel_that_stands_still():
    time_s = np.arange(3000) * 0.01
    position = np.round(np.clip(time_s - 10.0, 0.0, 1.0) * 5.0 / 0.025) * 0.025  # a move of a second, in 0.025 mm
    misfit = 0.8 * np.exp(-((time_s - 11.0) ** 2))
    noise = measured_noise([np.gradient(position)], [position], [misfit], 0.01)
    assert noise.colour == ()
    assert 0.005 < noise.std < 0.03
