"""The path that is checked before a run holds whatever the run may drive."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from procedures._steady_sine import Patience, Tone, steady_path

PATIENCE = Patience(settling_s=0.5, periods=2, seconds=0.0, tolerance=0.01, longest_wait_s=5.0)


@given(
    frequency_hz=st.floats(0.2, 5.0),
    amplitude=st.floats(0.1, 50.0),
    bias=st.floats(-50.0, 50.0),
    rate_hz=st.sampled_from([100.0, 250.0, 1000.0]),
)
def test_a_sine_that_lasts_longer_stays_within_its_checked_path(frequency_hz, amplitude, bias, rate_hz):
    tones = [Tone(0.7, amplitude, bias), Tone(frequency_hz, amplitude, bias)]
    path = steady_path(tones, PATIENCE, rate_hz)
    assert path.min() == pytest.approx(bias - amplitude, abs=1e-12)
    assert path.max() == pytest.approx(bias + amplitude, abs=1e-12)
    assert len(path) == sum(round(PATIENCE.expected_s(tone.frequency_hz) * rate_hz) for tone in tones)
    assert np.isfinite(path).all()
