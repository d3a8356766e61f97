"""First-order models of one sine: exact for a held command, as uncertain as repeats, refused where nothing moves."""

import json
import math

import numpy as np
import pytest

from hil.errors import InputError
from hil.identification.grey_box.identify import fit_plant, starting_model
from hil.identification.papers.first_order import first_order
from hil.identification.preparation.experiment import experiment
from hil.physics.transfer_function import from_parameters
from hil.record.read import write_recording
from hil.record.recording import recording
from hil.signals.steps import step_sequence
from tests.binary_sequence import binary_sequence

INTERVAL_S = 0.02
FINE = 20
TIME_S = np.arange(0.0, 62.8, INTERVAL_S)
SINE = 5.0 - 5.0 * np.cos(TIME_S)  # 1 rad/s between 0 and 10, whole periods
STEPS = step_sequence([0.0, 5.0, 0.0, -5.0, 0.0, 3.0, 0.0, -3.0], 4.0, 1 / INTERVAL_S)

GAIN, LAG_S, SECOND_S, DEAD_S = 0.2034, 0.2595, 0.15, 0.093
AXIS = np.convolve([LAG_S, 1.0], [SECOND_S, 1.0])
AT_6_RAD_S = GAIN * np.exp(-DEAD_S * 6j) / (6j * np.polyval(AXIS, 6j))


def recorded(command, denominator, *, dead_s=0.0, noise=0.01, start=0.3, drift_per_s=0.0, seed=0):
    """A plant driven by a held command, made on a grid twenty times finer by another tool."""
    from scipy import signal

    fine = np.repeat(command, FINE) - command[0]
    late = round(dead_s / INTERVAL_S * FINE)
    fine = np.concatenate((np.zeros(late), fine))[: len(fine)]
    top, below, _ = signal.cont2discrete(([GAIN], denominator), INTERVAL_S / FINE)
    time_s = INTERVAL_S * np.arange(len(command))
    clean = signal.lfilter(top.ravel(), below, fine)[::FINE] + start + drift_per_s * time_s
    output = clean + noise * np.random.default_rng(seed).normal(size=len(command))
    return recording("axis", time_s, {"command [V]": command, "position [V]": output})


def fitted(made, *, integrates, skip_s=0.0):
    return first_order(made, "command", "position", integrates=integrates, skip_s=skip_s)


@pytest.mark.parametrize(("below", "integrates"), [([LAG_S, 1.0], False), ([LAG_S, 1.0, 0.0], True)])
def test_a_held_command_is_exact(below, integrates):
    found = fitted(recorded(STEPS, below, noise=0.0), integrates=integrates)
    assert found.gain == pytest.approx(GAIN, rel=1e-6) and found.time_s == pytest.approx(LAG_S, rel=1e-6)
    assert found.fit_percent == pytest.approx(100.0, abs=1e-4)


def test_the_uncertainty_is_that_of_repeats():
    off = []
    for seed in range(12):
        found = fitted(recorded(STEPS, [LAG_S, 1.0, 0.0], noise=0.05, seed=seed), integrates=True)
        off += [(found.gain - GAIN) / found.gain_std, (found.time_s - LAG_S) / found.time_std_s]
    assert 0.6 < np.sqrt(np.mean(np.square(off))) < 1.5


def test_drift_of_an_integrator_is_told_apart_from_its_gain():
    found = fitted(recorded(STEPS, [LAG_S, 1.0, 0.0], drift_per_s=-0.05), integrates=True)
    assert found.drift_per_s == pytest.approx(-0.05, abs=1e-3)
    assert abs(found.gain - GAIN) < 4 * found.gain_std


def test_one_sine_fits_a_plant_of_another_order_and_a_binary_sequence_decides():
    below = np.append(AXIS, 0.0)
    found = fitted(recorded(SINE, below, dead_s=DEAD_S), integrates=True, skip_s=6.28)
    assert found.fit_percent > 99.9  # which says nothing about its order:
    model = found.gain / (6j * (1 + 6j * found.time_s))
    assert abs(np.angle(model / AT_6_RAD_S, deg=True)) > 30.0
    binary = np.append(np.zeros(100), binary_sequence(-5.0, 5.0, 0.3, 1 / INTERVAL_S, bits=7))
    start = starting_model("transfer-function")
    rich = fit_plant(
        start, [experiment(recorded(binary, below, dead_s=DEAD_S), start.definition, "command", "position")]
    )
    assert rich.model.origin["structure"] == "integrator, 2 poles, dead time"
    chosen = from_parameters(rich.model.values)
    assert chosen.dead_time_s == pytest.approx(DEAD_S, abs=4e-3)
    assert chosen.at(np.array([6 / (2 * math.pi)]))[0] == pytest.approx(AT_6_RAD_S, rel=0.01)


@pytest.mark.parametrize(
    ("command", "output", "told"),
    [
        (SINE[:40], SINE[:40], "40 samples"),
        (np.ones(200), SINE[:200], "'command' stands still"),
        (SINE[:200], np.ones(200), "'position' stands still"),
    ],
)
def test_what_cannot_be_fitted_is_refused(command, output, told):
    made = recording("bad", INTERVAL_S * np.arange(len(command)), {"command [V]": command, "position [V]": output})
    with pytest.raises(InputError, match=told):
        fitted(made, integrates=False)


def test_the_prompt_fits_an_own_recording_and_writes_its_transfer_function(tmp_path, prints):
    path, out = tmp_path / "axis.csv", tmp_path / "model.json"
    write_recording(recorded(STEPS, [LAG_S, 1.0, 0.0]), path)
    names = ("--input", "command", "--output", "position", "--integrates")
    found = json.loads(prints("analyse", "process", path, *names, "--out", out, "--json"))
    assert found["gain"] == pytest.approx(GAIN, abs=4 * found["gain_std"])
    assert found["time_s"] == pytest.approx(LAG_S, abs=4 * found["time_std_s"])
    (written,) = json.loads(out.read_text())["transfer_functions"]
    assert written["denominator"] == pytest.approx([1.0, 1.0 / found["time_s"], 0.0])
    assert prints("analyse", "process", path, *names).startswith("P1I, gain 0.203")
