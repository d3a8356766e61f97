"""Smooth curves, tones and rounding: what figures are read from."""

import numpy as np
import pytest

from hil.signals.autoregression import whitened, whitener_of
from hil.signals.harmonic_order import sine_fit_beyond
from hil.signals.rounding import mean_rounding_std, rounding_step
from hil.signals.sine_fit import sine_fit
from hil.signals.smooth_curve import Smoother
from hil.signals.tone import standing_tone

RNG = np.random.default_rng(5)
TIME_S = np.arange(2000) / 1000.0


def test_a_smooth_curve_is_as_stiff_as_the_samples_ask_for():
    smoother = Smoother.on(TIME_S, 60)
    bent = np.sin(2.0 * np.pi * 3.0 * TIME_S)
    noise = 0.1 * RNG.normal(size=(2, len(TIME_S)))
    found = smoother.curves(np.stack((bent, TIME_S)) + noise)
    assert found.noise_std == pytest.approx([0.1, 0.1], rel=0.1)
    assert np.std(smoother.at(found) - np.stack((bent, TIME_S)), axis=1) == pytest.approx([0.01, 0.004], abs=0.006)
    slope = smoother.slopes(found)[0]
    assert np.std(slope - 6.0 * np.pi * np.cos(6.0 * np.pi * TIME_S)) < 0.1 * np.std(slope)


def test_a_smooth_curve_and_its_slope_are_those_of_its_b_splines_and_go_on_beyond_the_samples():
    from scipy.interpolate import BSpline

    smoother = Smoother.on(TIME_S, 20)
    curves = smoother.curves(np.sin(2.0 * np.pi * 3.0 * TIME_S)[None, :])
    spline = BSpline(smoother.knots, curves.coefficients[0], 3)
    places = np.linspace(-0.1, TIME_S[-1] + 0.1, 300)
    values, slopes = smoother.beside(curves, places)
    assert values[0] == pytest.approx(spline(places), abs=1e-9)
    assert slopes[0] == pytest.approx(spline(places, 1), abs=1e-7)


def test_white_noise_needs_no_whitener_and_coloured_noise_gets_its_own():
    from scipy.signal import lfilter

    white = RNG.normal(size=2000)
    coloured = lfilter([1.0], [1.0, -0.8], white)
    assert len(whitener_of(white)) == 1
    assert whitener_of(coloured)[1] == pytest.approx(-0.8, abs=0.05)


def test_a_tone_in_both_stretches_is_found_and_noise_is_none():
    stretches = [(at_s, 0.7 * np.sin(2.0 * np.pi * 10.3 * at_s + 0.4) + 0.3 * RNG.normal(size=len(at_s)))
                 for at_s in (TIME_S[:1000] - 1.0, TIME_S[:600] + 3.4)]  # fmt: skip
    tone = standing_tone(stretches)
    assert tone is not None
    assert tone.frequency_hz == pytest.approx(10.3, abs=0.02)
    assert np.std(tone.at(TIME_S) - 0.7 * np.sin(2.0 * np.pi * 10.3 * TIME_S + 0.4)) < 0.06
    assert all(standing_tone([(TIME_S, RNG.normal(size=2000))]) is None for _ in range(20))


def test_the_step_of_a_converter_is_seen_and_what_it_hides():
    readings = 0.195 * np.rint((50.0 + 0.3 * RNG.normal(size=5000)) / 0.195)
    assert rounding_step(readings) == pytest.approx(0.195)
    assert rounding_step(RNG.normal(size=5000)) == 0.0
    assert mean_rounding_std(0.0, 1.0) == pytest.approx(12.0**-0.5, rel=0.05)
    levels = RNG.random(400)
    off = [np.mean(np.rint(level + 0.3 * RNG.normal(size=4000))) - level for level in levels]
    # readings that reach two codes alone do not tell how much noise was there: the bound is that of none
    assert np.std(off) < mean_rounding_std(np.hypot(0.3, 12.0**-0.5), 1.0) == mean_rounding_std(0.0, 1.0)
    assert mean_rounding_std(np.hypot(0.5, 12.0**-0.5), 1.0) < 0.01


def test_harmonics_of_a_slow_sine_are_no_noise():
    bent = np.sign(np.sin(2.0 * np.pi * 1.5 * TIME_S)) + 0.1 * RNG.normal(size=len(TIME_S))
    plain, beyond = (fit(TIME_S, bent, 1.5) for fit in (sine_fit, sine_fit_beyond))
    assert beyond.amplitude_std < 0.5 * plain.amplitude_std
    assert beyond.amplitude == pytest.approx(4.0 / np.pi, abs=0.02)
    assert len(beyond.phasors) == 5


def test_samples_and_basis_are_made_white_by_the_same_filter():
    from scipy.signal import lfilter

    values, whitener = np.random.default_rng(3).normal(size=(60, 40)), np.array([1.0, -0.5, 0.2, 0.1])
    assert whitened(values, whitener) == pytest.approx(lfilter(whitener, [1.0], values), abs=1e-13)
