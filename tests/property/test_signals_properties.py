import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.signals.multisine import odd_multisine
from hil.signals.sine_fit import sine_fit

amplitudes = st.floats(1e-3, 1e3)
phases = st.floats(-math.pi, math.pi)


@settings(max_examples=60, deadline=None)
@given(
    amplitude=amplitudes,
    phase=phases,
    offset=st.floats(-1e3, 1e3),
    frequency=st.floats(0.4, 8.0),
    start=st.floats(-1e3, 1e3),
    jitter=st.booleans(),
)
def test_a_noise_free_sine_is_returned_whatever_its_numbers(amplitude, phase, offset, frequency, start, jitter):
    t = start + np.arange(600) / 200.0
    if jitter:
        t = t + np.random.default_rng(0).uniform(0, 0.004, len(t))
    fit = sine_fit(t, offset + amplitude * np.sin(2 * np.pi * frequency * t + phase), frequency)
    scale = amplitude + abs(offset)
    assert abs(fit.phasor - amplitude * np.exp(1j * phase)) < 1e-8 * scale
    assert abs(fit.offset - offset) < 1e-8 * scale


@settings(max_examples=30, deadline=None)
@given(shift=st.floats(0.0, 5.0), scale=st.floats(0.1, 10.0))
def test_a_fit_turns_with_time_and_scales_with_the_signal(shift, scale):
    rng = np.random.default_rng(1)
    t = np.arange(500) / 100.0
    y = np.sin(2 * np.pi * t) + 0.1 * rng.normal(size=len(t))
    here, there = sine_fit(t, y, 1.0), sine_fit(t + shift, scale * y, 1.0)
    assert np.isclose(there.phasor, scale * here.phasor * np.exp(-2j * np.pi * shift), rtol=1e-6)
    assert np.isclose(there.amplitude_std, scale * here.amplitude_std, rtol=1e-6)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), group=st.integers(2, 6), peak=st.floats(0.1, 100.0))
def test_every_multisine_keeps_its_peak_and_its_silent_lines(seed, group, peak):
    made = odd_multisine(0.2, 9.8, 0.2, 400.0, peak, group=group, seed=seed, crest_iterations=20)
    spectrum = np.abs(np.fft.rfft(made.period))
    assert np.isclose(np.max(np.abs(made.period)), peak)
    assert spectrum[made.odd_detection].max() < 1e-9 * spectrum.max()
    assert spectrum[made.even_detection].max() < 1e-9 * spectrum.max()
