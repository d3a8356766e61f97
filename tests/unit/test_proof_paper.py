"""Recordings of the published models have the level, the gain and the noise that they should."""

import numpy as np
import pytest

from hil.physics.published import tordal
from hil.signals.sine_fit import sine_fit
from tests.studies.proof.paper import NOISE_LPM, RATE_HZ, SLOPE, recorded


@pytest.mark.parametrize("run", tordal.RUNS, ids=lambda run: run.name)
def test_a_slow_sine_has_the_gain_of_the_metering_edge(run):
    made = recorded(run.name, run.transfer_function, run.amplitude, run.bias, seed=1)
    slow = slice(round(2.0 * RATE_HZ), round(22.0 * RATE_HZ))  # 0.1 Hz, two periods
    flow = made.values("flow")[slow]
    fit = sine_fit(made.time_s[slow], flow, 0.1)
    expected = SLOPE * run.amplitude * abs(run.transfer_function.at(np.array([0.1]))[0]) / run.transfer_function.dc_gain
    assert abs(fit.phasor) == pytest.approx(expected, rel=0.02)
    level = np.sign(run.bias) * SLOPE * (abs(run.bias) - tordal.DEAD_BAND_LPM)
    assert fit.offset == pytest.approx(level, abs=0.1)
    assert np.std(np.diff(flow)) / np.sqrt(2.0) == pytest.approx(NOISE_LPM, rel=0.05)
