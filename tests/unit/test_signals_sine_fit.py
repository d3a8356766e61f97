import math

import numpy as np
import pytest

from hil.errors import SettingError
from hil.signals.colour import colour_factor, colour_factors
from hil.signals.frequency_fit import frequency_of
from hil.signals.recursion import filtered
from hil.signals.sine_fit import sine_fit


def stamps(rate_hz=1000.0, seconds=3.0):
    return np.arange(round(rate_hz * seconds)) / rate_hz


def distorted(t, f=1.3):
    """Fundamental 4 at 0.7 rad, harmonics 3 and 5, on a creeping level."""
    w = 2 * np.pi * f
    return (
        50 + 4 * np.sin(w * t + 0.7) + 0.3 * np.sin(3 * w * t - 1.1) + 0.05 * np.cos(5 * w * t) + 0.2 * (t - t.mean())
    )


def uneven(rng, n=2500, seconds=4.0):
    return np.sort(rng.uniform(0.0, seconds, n))


@pytest.mark.parametrize("t", [stamps(), stamps(seconds=2.7183), uneven(np.random.default_rng(3))])
def test_recovers_a_distorted_drifting_sine_exactly(t):
    fit = sine_fit(t, distorted(t), 1.3, drift_order=1)
    assert fit.amplitude == pytest.approx(4.0, rel=1e-10)
    assert fit.phase_rad == pytest.approx(0.7, abs=1e-10)
    assert abs(fit.phasors[2]) == pytest.approx(0.3, rel=1e-9)
    assert np.angle(fit.phasors[2]) == pytest.approx(-1.1, abs=1e-9)
    assert abs(fit.phasors[4]) == pytest.approx(0.05, rel=1e-8)
    assert fit.distortion == pytest.approx(math.hypot(0.3, 0.05) / 4.0, rel=1e-9)
    assert fit.drift[0] == pytest.approx(0.2 * (t[-1] - t[0]) / 2, rel=1e-9)


@pytest.mark.parametrize("t", [stamps(60, 2.31), uneven(np.random.default_rng(5), 130, 2.31)])
def test_is_the_best_linear_unbiased_estimator(t):
    # Unit impulses give the estimator's matrix row by row; its variance must be the Cramér–Rao bound itself.
    def parameters(values):
        fit = sine_fit(t, values, 1.1, harmonics=2, drift_order=1)
        pairs = np.column_stack((fit.phasors.real, fit.phasors.imag)).ravel()
        return np.concatenate(([fit.offset], pairs, fit.drift))

    matrix = np.array([parameters(impulse) for impulse in np.eye(len(t))]).T
    fit = sine_fit(t, np.random.default_rng(1).normal(size=len(t)), 1.1, harmonics=2, drift_order=1)
    assert np.allclose(matrix @ matrix.T, fit.bound / fit.residual_std**2, rtol=1e-8, atol=1e-14)


def test_stated_intervals_cover_white_noise():
    rng = np.random.default_rng(7)
    t = stamps(200, 3.0)
    clean = 10 * np.sin(2 * np.pi * 1.7 * t + 0.3)
    inside = 0
    for _ in range(400):
        fit = sine_fit(t, clean + rng.normal(size=len(t)), 1.7)
        inside += abs(fit.amplitude - 10) < 1.96 * fit.amplitude_std
        inside += abs(fit.phase_rad - 0.3) < 1.96 * fit.phase_std_rad
    assert 0.93 <= inside / 800 <= 0.99


def test_intervals_widen_with_the_colour_of_the_noise():
    rng = np.random.default_rng(11)
    t = stamps(1000, 8.0)
    inside = optimistic = 0
    for _ in range(150):
        red = filtered([1.0], [1.0, -0.95], rng.normal(size=len(t)))
        fit = sine_fit(t, 20 * np.sin(2 * np.pi * 0.7 * t) + red, 0.7, harmonics=3)
        error = abs(fit.amplitude - 20)
        inside += error < 1.96 * fit.amplitude_std
        optimistic += error < 1.96 * math.sqrt(fit.bound[1, 1])
    assert inside / 150 >= 0.90
    assert optimistic / 150 < 0.6


def test_colour_factor_is_one_for_white_and_the_known_ratio_for_first_order_noise():
    rng = np.random.default_rng(2)
    white = rng.normal(size=40_000)
    red = filtered([1.0], [1.0, -0.8], white)
    assert colour_factor(white) < 1.15
    assert colour_factor(red) == pytest.approx(1.8 / 0.2, rel=0.2)  # (1 + a)/(1 − a)
    assert colour_factors(red, np.array([0.5]))[0] == 1.0


def test_colour_of_a_perfect_fit_is_one():
    assert colour_factor(np.zeros(1000)) == 1.0
    assert colour_factor(np.arange(5.0)) == 1.0


def test_free_frequency_scatters_by_the_bound():
    rng = np.random.default_rng(4)
    t = 100.0 + stamps(1000, 5.0)  # the recording does not start at zero
    sine = 50 + 10 * np.sin(2 * np.pi * 1.7 * t + 0.4)
    errors = [frequency_of(t, sine + rng.normal(size=len(t))) - 1.7 for _ in range(60)]
    bound_hz = math.sqrt(6.0 / len(t)) / (math.pi * 5.0 * 10.0)  # Rife and Boorstyn, for many periods
    assert np.std(errors) == pytest.approx(bound_hz, rel=0.3)


def test_free_frequency_on_uneven_stamps():
    t = uneven(np.random.default_rng(8), 3000, 6.0)
    assert frequency_of(t, 50 + 4 * np.sin(2 * np.pi * 1.31 * t + 0.7)) == pytest.approx(1.31, rel=1e-9)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"frequency_hz": 0.0}, "must be above 0"),
        ({"frequency_hz": 120.0}, "beyond half the sample rate"),
        ({"frequency_hz": 0.1}, "periods of 0.1 Hz"),
        ({"frequency_hz": 1.0, "harmonics": 0}, "at least 1"),
    ],
)
def test_refuses_what_cannot_be_fitted(arguments, said):
    t = stamps()
    with pytest.raises(SettingError, match=said):
        sine_fit(t, np.sin(t), **arguments)


def test_refuses_too_few_samples_and_columns_that_look_alike():
    t = stamps(10, 1.0)
    with pytest.raises(SettingError, match="for 11 unknowns"):
        sine_fit(t, np.sin(t), 0.5)
    t = stamps(1000, 0.02)
    with pytest.raises(SettingError, match="cannot tell"):
        sine_fit(t, np.sin(t), 0.05, harmonics=1, drift_order=3)
