"""Good, prototype and returned EFC valves as parameter sets: published corners and orders, stable models of them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hil.identification.frequency.frequency_response import from_table
from hil.identification.frequency.order_choice import fit_transfer_function
from hil.identification.frequency.sine_test import sine_test
from hil.identification.papers.asymptotic_bode import asymptotic_bode
from hil.identification.papers.recursive_least_squares import ArxForm, RecursiveLeastSquares
from hil.physics.published.efc_population import CORNERS_HZ, valve
from hil.physics.published.tugsal import FREQUENCY_MODELS
from hil.physics.simulate import Drive, simulate
from tests.binary_sequence import binary_sequence

FREQUENCIES_HZ = np.array([0.2, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0])
# Bias and amplitude in A that swing between 19 and 21, 20 and 140, 133 and 147 psi.
LEVELS = {"low": (1.369, 0.006), "medium": (1.532, 0.163), "high": (1.697, 0.039)}
RATE_HZ = 100.0


def response(name, level, friction_a=None):
    model = valve(name, friction_a)
    bias, amplitude = LEVELS[level]
    test = sine_test(FREQUENCIES_HZ, amplitude, bias)
    return test.response(model.definition, model.values | {"sensor_lag": 0.0}, model.active_effects)


def crossed(frequency_hz, values, level):
    i = int(np.argmax(values < level))
    assert i > 0, "does not fall so far"
    return float(np.interp(-level, -values[i - 1 : i + 1], frequency_hz[i - 1 : i + 1]))


def corners(h, frequency_hz=FREQUENCIES_HZ):
    decibel = 20 * np.log10(np.abs(h) / np.abs(h[0]))
    return (crossed(frequency_hz, decibel, -20 * math.log10(math.sqrt(2))),
            crossed(frequency_hz, np.degrees(np.unwrap(np.angle(h))), -90.0))  # fmt: skip


@pytest.mark.parametrize("name", CORNERS_HZ)
def test_sets_have_their_corners(name):
    assert corners(response(name, "high", friction_a=0.0)) == pytest.approx(CORNERS_HZ[name], rel=0.03)


@pytest.mark.parametrize("name", ["good", "return"])
def test_corners_are_those_of_the_thesis_s_transfer_functions_read_as_hertz(name):
    fine_hz = np.linspace(0.05, 12.0, 4000)
    read_as_hz = FREQUENCY_MODELS[name].reduced().at(fine_hz / (2.0 * math.pi))
    assert corners(read_as_hz, fine_hz) == pytest.approx(CORNERS_HZ[name], rel=0.01)


@pytest.mark.parametrize("level", ["low", "medium"])
def test_returned_decays_first_then_prototype_then_good(level):
    half = [corners(response(name, level))[0] for name in ("return", "prototype", "good")]
    assert half == sorted(half) and half[0] < 0.9 * half[2]


def test_friction_takes_gain_where_the_amplitude_is_small():
    low, medium = (np.abs(response("return", level)[0] / response("return", level, friction_a=0.0)[0])
                   for level in ("low", "medium"))  # fmt: skip
    assert low < 0.75 and medium > 0.98


@pytest.mark.parametrize("name", CORNERS_HZ)
def test_recursive_least_squares_gives_stable_models_with_these_corners(name):
    from scipy.signal import freqz

    model = valve(name, friction_a=0.0)
    shaken = binary_sequence(1.69, 1.71, 0.03, RATE_HZ, bits=9, periods=2)
    command = np.concatenate((np.full(50, 1.7), shaken))
    drive = Drive(command[None, :], math.nan, 1.0 / RATE_HZ)
    pressure = simulate(model.definition, model.values | {"sensor_lag": 0.0}, drive, model.active_effects)[0]
    pressure += 0.02 * np.random.default_rng(0).normal(size=len(pressure))
    made = RecursiveLeastSquares(ArxForm(7, 6, delay=1), prior_std=1e4)
    made.run(command - 1.7, pressure - pressure[:50].mean())
    assert made.excitation.enough
    assert np.abs(made.poles).max() < 0.95
    fine_hz = np.linspace(0.05, 12.0, 2000)
    held = np.sinc(fine_hz / RATE_HZ) * np.exp(-1j * np.pi * fine_hz / RATE_HZ)
    h = freqz(made.numerator, made.denominator, 2.0 * np.pi * fine_hz / RATE_HZ)[1] / held
    assert corners(h, fine_hz) == pytest.approx(CORNERS_HZ[name], rel=0.03)


def test_evidence_wants_few_poles_of_the_simulated_valve_and_the_magnitude_alone_misses_its_delay():
    h = response("good", "high", friction_a=0.0)
    table = from_table("good", FREQUENCIES_HZ, 20 * np.log10(np.abs(h)), np.degrees(np.unwrap(np.angle(h))))
    rng = np.random.default_rng(0)
    noise = 0.01 * np.abs(h) * (rng.normal(size=len(h)) + 1j * rng.normal(size=len(h))) / math.sqrt(2)
    covariance = np.eye(2) * ((0.01 * np.abs(h)) ** 2 / 2)[:, None, None]
    lines = replace(table, response=h + noise, covariance=covariance)
    chosen = fit_transfer_function(lines)
    assert chosen.form.poles <= 3 and chosen.fit_percent > 97.0
    by_magnitude = asymptotic_bode(lines, 2)
    assert by_magnitude.rms_db < 0.3
    lag = np.degrees(np.angle(h[-1] / by_magnitude.model.at(FREQUENCIES_HZ[-1:])[0]))
    assert lag < -15.0
