"""What real recordings taught about noise: they stand still for long, and simple models miss them slowly."""

import numpy as np

from hil.identification.grey_box.witnesses import repeat_difference
from hil.identification.uncertainty.noise import measured_noise
from hil.signals.recursion import filtered


def test_a_misfit_does_not_pass_for_the_noise_of_a_channel_that_stands_still():
    time_s = np.arange(3000) * 0.01
    position = np.round(np.clip(time_s - 10.0, 0.0, 1.0) * 5.0 / 0.025) * 0.025  # a move of a second, in 0.025 mm
    misfit = 0.8 * np.exp(-((time_s - 11.0) ** 2))
    noise = measured_noise([position], [], [misfit], 0.01).noise
    assert noise.colour == ()
    assert 0.005 < noise.std < 0.03


def test_rest_after_rest_is_no_repetition():
    command = np.zeros(3000)
    command[1000:1100] = 1.0
    assert repeat_difference(command, command) is None
    assert repeat_difference(np.tile(command, 2), np.tile(command, 2)) is not None


def test_a_slow_misfit_of_a_single_recording_is_not_called_coloured_noise():
    generator = np.random.default_rng(3)
    command = filtered([0.05], [1.0, -0.95], generator.standard_normal(1000))
    drift = filtered([1.0], [1.0, -0.999], generator.standard_normal(1000))
    level = np.cumsum(command)
    noise = measured_noise([level + drift], [], [drift], 4.0).noise
    assert noise.std < 0.2 * np.std(drift)
