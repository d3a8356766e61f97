"""Process models: what is simulated is exact, what is chosen is what was there, what cannot be known is not claimed."""

import math

import numpy as np
import pytest
from scipy import signal

from hil.errors import InputError
from hil.identification.papers.process_model import ProcessForm, excitation, process_model
from hil.record.recording import recording
from hil.signals.multisine import odd_multisine
from hil.signals.steps import binary_sequence, step_sequence

INTERVAL_S = 0.02
FINE = 20
TIME_S = np.arange(0.0, 62.8, INTERVAL_S)
SINE = 5.0 - 5.0 * np.cos(TIME_S)  # 1 rad/s between 0 and 10, whole periods
STEPS = step_sequence([0.0, 5.0, 0.0, -5.0, 0.0, 3.0, 0.0, -3.0], 4.0, 1 / INTERVAL_S)
BINARY = binary_sequence(-5.0, 5.0, 0.3, 1 / INTERVAL_S, bits=7)

GAIN, LAG_S, SECOND_S, DEAD_S = 0.2034, 0.2595, 0.15, 0.093
AXIS = np.convolve([LAG_S, 1.0], [SECOND_S, 1.0])


def recorded(command, denominator, numerator=GAIN, *, dead_s=0.0, noise=0.01, start=0.3, drift_per_s=0.0, seed=0):
    """A plant driven by a held command, made on a grid twenty times finer by another tool."""
    fine = np.repeat(command, FINE) - command[0]
    late = round(dead_s / INTERVAL_S * FINE)
    fine = np.concatenate((np.zeros(late), fine))[: len(fine)]
    top, below, _ = signal.cont2discrete((np.atleast_1d(numerator), denominator), INTERVAL_S / FINE)
    time_s = INTERVAL_S * np.arange(len(command))
    clean = signal.lfilter(top.ravel(), below, fine)[::FINE] + start + drift_per_s * time_s
    output = clean + noise * np.random.default_rng(seed).normal(size=len(command))
    return recording("axis", time_s, {"command [V]": command, "position [V]": output})


def fitted(made, **asked):
    return process_model(made, "command", "position", **asked)


@pytest.mark.parametrize("dead_s", [0.0, 0.093, 0.1])
def test_a_dead_time_of_parts_of_a_sample_is_exact(dead_s):
    made = recorded(BINARY, np.append(AXIS, 0.0), dead_s=dead_s, noise=0.0)
    found = fitted(made, lags=2, integrator=True, dead_time=True)
    assert np.max(np.abs(found.residuals)) < 1e-4
    assert found.values["dead_time"] == pytest.approx(dead_s, abs=2e-4)
    assert found.gain == pytest.approx(GAIN, rel=1e-4)
    assert found.drift_per_s == pytest.approx(0.0, abs=1e-5)


def test_order_integrator_and_dead_time_are_chosen_as_they_are():
    found = fitted(recorded(BINARY, np.append(AXIS, 0.0), dead_s=DEAD_S))
    assert found.form == ProcessForm(2, integrator=True, dead_time=True)
    assert found.form.name == "P2DI"
    assert found.determined
    assert found.notes == ()
    truth = {
        "gain": GAIN, "dead_time": DEAD_S, "pair_time": math.sqrt(LAG_S * SECOND_S),
        "damping": (LAG_S + SECOND_S) / 2 / math.sqrt(LAG_S * SECOND_S),
    }  # fmt: skip
    for name, value in truth.items():
        assert abs(found.values[name] - value) < 4 * found.std[name], name
    assert {one.form.integrator for one in found.tried} == {True, False}
    assert "P2DI" in found.summary()


def test_a_lag_without_an_integrator_is_not_given_one():
    found = fitted(recorded(STEPS, [LAG_S, 1.0]))
    assert found.form.name == "P1"
    assert found.drift_per_s == 0.0
    assert abs(found.values["time"] - LAG_S) < 4 * found.std["time"]


def test_an_oscillating_pair_and_a_zero():
    found = fitted(
        recorded(BINARY, [0.04, 2 * 0.2 * 0.3, 1.0], [0.1 * GAIN, GAIN]), lags=2, integrator=False, zero=True
    )
    truth = {"pair_time": 0.2, "damping": 0.3, "zero_time": 0.1}
    for name, value in truth.items():
        assert abs(found.values[name] - value) < 4 * found.std[name], name
    assert found.model.poles[0].imag != 0.0


def test_the_uncertainty_is_that_of_repeats():
    off = []
    for seed in range(12):
        found = fitted(
            recorded(STEPS, [LAG_S, 1.0, 0.0], noise=0.05, seed=seed), lags=1, integrator=True, dead_time=True
        )
        truth = {"gain": GAIN, "time": LAG_S}
        off += [(found.values[name] - value) / found.std[name] for name, value in truth.items()]
    assert 0.6 < np.sqrt(np.mean(np.square(off))) < 1.5


def test_drift_of_an_integrator_is_told_apart_from_its_gain():
    found = fitted(recorded(BINARY, [LAG_S, 1.0, 0.0], drift_per_s=-0.05), lags=1, integrator=True, dead_time=False)
    assert found.drift_per_s == pytest.approx(-0.05, abs=1e-3)
    assert abs(found.gain - GAIN) < 4 * found.std["gain"]


def test_what_a_command_can_tell_apart():
    assert excitation(SINE) == 2
    assert excitation(SINE + np.sin(3.0 * TIME_S)) == 4
    assert excitation(BINARY) == excitation(STEPS) == 12
    multisine = odd_multisine(0.05, 1.0, 0.05, 1 / INTERVAL_S, 5.0, crest_iterations=0)
    assert excitation(multisine.signal(2)) == 12


def test_one_sine_supports_a_gain_and_one_time_whatever_the_plant_is():
    found = fitted(recorded(SINE, np.append(AXIS, 0.0), dead_s=DEAD_S))
    assert found.excitation == 2
    assert {one.form.unknowns for one in found.tried} == {2}
    assert "Models with more were not tried" in found.notes[0]
    assert "P3DI" in found.notes[0]
    assert found.fit_percent > 99.9  # which says nothing about its order:
    plant = GAIN * np.exp(-DEAD_S * 6j) / (6j * np.polyval(AXIS, 6j))
    model = found.model.at(np.array([6 / (2 * math.pi)]))[0]
    assert abs(np.angle(model / plant, deg=True)) > 30.0


def test_a_third_order_that_is_asked_of_one_sine_is_told_to_be_unknown():
    steady = recorded(SINE, np.append(AXIS, 0.0), dead_s=DEAD_S)
    asked = fitted(steady, lags=3, integrator=True, dead_time=True, skip_s=6.28)
    simple = fitted(steady, lags=1, integrator=True, dead_time=False, skip_s=6.28)
    assert not asked.determined
    assert "2 numbers; P3DI has 5" in asked.notes[0]
    assert "Not determined by these data" in asked.notes[1]
    assert asked.fit_percent - simple.fit_percent < 0.01
    # a binary sequence of the same size and length decides
    rich = fitted(recorded(BINARY, np.append(AXIS, 0.0), dead_s=DEAD_S))
    assert rich.form.name == "P2DI"
    assert rich.determined
    at = np.array([6 / (2 * math.pi)])
    plant = GAIN * np.exp(-DEAD_S * 6j) / (6j * np.polyval(AXIS, 6j))
    assert rich.model.at(at)[0] == pytest.approx(plant, rel=0.02)


@pytest.mark.parametrize(
    ("command", "output", "asked", "told"),
    [
        (SINE[:40], SINE[:40], {}, "40 samples"),
        (np.ones(200), SINE[:200], {}, "'command' stands still"),
        (SINE[:200], np.ones(200), {}, "'position' stands still"),
        (SINE[:200], SINE[:200], {"lags": 4}, "4 lags; allowed are 1 to 3"),
        (SINE[:200], SINE[:200], {"lags": 1, "integrator": False, "zero": True}, "a zero needs two poles"),
        (SINE, SINE, {"lags": 3}, "tells 2 numbers apart, the simplest process model has 4"),
    ],
)
def test_what_cannot_be_fitted_is_refused(command, output, asked, told):
    made = recording("bad", INTERVAL_S * np.arange(len(command)), {"command [V]": command, "position [V]": output})
    with pytest.raises(InputError, match=told):
        fitted(made, **asked)
