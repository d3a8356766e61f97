"""A PWM current with its carrier behind the simulated bench: ripple, dither, hysteresis, open and short circuit."""

import numpy as np
import pytest

import hil

pytestmark = pytest.mark.usefixtures("unprinted")
BENCH = """based_on = "cummins-efc"
name = "coil"
[channels.current]
pwm = {{ carrier_hz = {carrier}, dither_hz = {dither_hz}, dither_amplitude = {amplitude} }}
[simulation]
effects = [{{ name = "friction", parameters = {{ coulomb = 0.03, stiction = 1.3 }} }}]
[simulation.instruments]
current.coil = {{ fault = "{fault}" }}
"""


def driven(tmp_path, *, carrier=1000.0, dither_hz=50.0, amplitude=0.0, fault="", current=1.6):
    """Coil current and pressure while a current is asked for, after it has settled."""
    path = tmp_path / "bench.toml"
    path.write_text(BENCH.format(carrier=carrier, dither_hz=dither_hz, amplitude=amplitude, fault=fault))
    run = tmp_path / f"run-{len(list(tmp_path.iterdir()))}"
    hil.run("step_response", path, run, levels=(0.0, 100.0 * current / 2.2), hold_s=1.0)
    read = hil.read(run)
    at = read.values("current") > 0.99 * current
    return read.values("coil current")[at][500:], read.values("pressure")[at][500:]


def test_carriers_are_told_apart_by_their_ripple(tmp_path):
    slow, fast = (driven(tmp_path, carrier=carrier)[0] for carrier in (100.0, 5000.0))
    assert slow.mean() == pytest.approx(1.6, abs=0.01) and fast.mean() == pytest.approx(1.6, abs=0.01)
    # U·D·(1 − D)/(L·f) about the mean of each millisecond; the fast one averages out
    assert 0.2 < np.ptp(slow) < 0.3
    assert np.ptp(fast) < 0.03


def test_dither_is_in_the_current_and_leaves_the_mean(tmp_path):
    still, shaken = (driven(tmp_path, amplitude=amplitude)[0] for amplitude in (0.0, 0.1))
    assert np.ptp(shaken) > 0.1 > 3.0 * np.ptp(still)
    assert shaken.mean() == pytest.approx(still.mean(), abs=5e-3)


@pytest.mark.parametrize("fault", ["open", "short"])
def test_a_coil_with_a_fault_carries_no_current(tmp_path, fault):
    path = tmp_path / "bench.toml"
    path.write_text(BENCH.format(carrier=1000.0, dither_hz=50.0, amplitude=0.0, fault=fault))
    hil.run("step_response", path, tmp_path / "run", levels=(0.0, 70.0), hold_s=0.5)
    read = hil.read(tmp_path / "run")
    asked = read.values("current") > 1.0
    assert np.abs(read.values("coil current")[asked][200:]).max() < 0.05
    assert read.values("pressure")[asked].max() < 10.0
    assert not hil.results(tmp_path / "run").transfer_functions


def loop(tmp_path, **pwm):
    """Hysteresis in mA, lag in ms."""
    results = swept(tmp_path, **pwm)
    return results["hysteresis"].value, results["lag"].value


def swept(tmp_path, **pwm):
    path = tmp_path / "bench.toml"
    path.write_text(BENCH.format(fault="", **{"carrier": 1000.0, "dither_hz": 50.0, "amplitude": 0.0} | pwm))
    run = tmp_path / f"run-{len(list(tmp_path.iterdir()))}"
    hil.run("pressure_current", path, run, cycle_s=20.0)
    return hil.results(run)


def test_dither_narrows_the_loop_that_friction_makes_and_gives_it_a_lag(tmp_path):
    (plain, late), (shaken, creeping) = loop(tmp_path), loop(tmp_path, amplitude=0.1)
    assert plain == pytest.approx(72.0, abs=4.0)
    assert shaken < 0.75 * plain
    assert late < 30.0 < 60.0 < creeping
