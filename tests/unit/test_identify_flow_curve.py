import numpy as np
import pytest

from hil.errors import InputError
from hil.identification.flow_curve import flow_curve, polynomial, spline
from hil.record.recording import recording
from hil.signals.ramps import triangle

RATE_HZ = 100.0


def metered(command, positive=20.0, negative=-18.0, exponent=1.2, full=70.0):
    up = np.maximum(command - positive, 0) / (100 - positive)
    down = np.maximum(negative - command, 0) / (100 + negative)
    return full * (up**exponent - down**exponent)


def sweep(lag_s=0.0, noise=0.3, play=0.0, seed=0, **curve):
    command = triangle(-100.0, 100.0, 80.0, RATE_HZ)
    time_s = np.arange(len(command)) / RATE_HZ
    shifted = np.interp(time_s - lag_s, time_s, command)
    opening = shifted - play * np.sign(np.gradient(shifted))
    flow = metered(opening, **curve) + 0.1 + noise * np.random.default_rng(seed).normal(size=len(command))
    return recording("sweep", time_s, {"command [%]": command, "flow [l/min]": flow})


def test_figures_of_a_known_curve_lie_within_their_uncertainty():
    found = flow_curve(sweep(), "command", "flow")
    for number, truth in (
        (found.dead_band_positive, 20.0),
        (found.dead_band_negative, -18.0),
        (found.rated_positive, 70.1),
        (found.rated_negative, -69.9),
        (found.leakage, 0.1),
    ):
        assert number.value == pytest.approx(truth, abs=max(4 * number.std, 0.15))
        assert number.std < 0.3
    assert (found.dead_band_positive.unit, found.rated_positive.unit) == ("%", "l/min")
    assert found.gain_positive.unit == "[l/min]/[%]"
    assert 0.9 < found.symmetry.value <= 1.0
    assert found.hysteresis.value < 0.5
    assert len(found.nominal) == len(found.command)


def test_edges_are_as_uncertain_as_they_scatter():
    edges = [flow_curve(sweep(noise=1.0, seed=s), "command", "flow").dead_band_positive for s in range(15)]
    assert np.mean([e.std for e in edges]) == pytest.approx(np.std([e.value for e in edges]), rel=0.6)


def test_hysteresis_is_the_width_along_the_command_and_lag_is_not_taken_for_it():
    assert flow_curve(sweep(play=2.0), "command", "flow").hysteresis.value == pytest.approx(2.0, abs=0.3)  # 4 of 200 %
    late = sweep(lag_s=0.2)
    assert flow_curve(late, "command", "flow").hysteresis.value > 0.7
    assert flow_curve(late, "command", "flow", lag_s=0.2).hysteresis.value < 0.5


def test_asymmetry_and_curvature_show():
    lame = sweep()
    flow = lame.values("flow")
    columns = {"command [%]": lame.values("command"), "flow [l/min]": np.where(flow > 0, flow, 0.8 * flow)}
    found = flow_curve(recording("lame", lame.time_s, columns), "command", "flow")
    assert found.symmetry.value == pytest.approx(0.8 * 80 / 82, abs=0.03)
    curved = flow_curve(sweep(exponent=1.8), "command", "flow").linearity.value
    assert curved > 3 * flow_curve(sweep(exponent=1.0), "command", "flow").linearity.value


def test_the_ninth_order_polynomial_ripples_in_the_dead_band_and_the_spline_does_not():
    command = np.linspace(-100, 100, 201)
    flow = np.sign(command) * np.maximum(np.abs(command) - 20, 0) * 70 / 80
    inside = np.linspace(-19, 19, 381)
    ninth, monotone = polynomial(command, flow), spline(command, flow)
    assert np.ptp(ninth(inside)) == pytest.approx(3.80, abs=0.01)  # l/min, where there is no flow
    slope = np.diff(ninth(np.linspace(-100, 100, 4001)))
    assert np.any(slope < 0)  # more command, less flow
    assert np.max(np.abs(monotone(inside))) == 0.0
    assert np.all(np.diff(monotone(np.linspace(-100, 100, 4001))) >= 0)
    assert np.max(np.abs(monotone(command) - flow)) < 1e-12
    assert np.max(np.abs(ninth(command) - flow)) > 1.0


def test_what_is_no_sweep_is_said():
    n = 4000
    time_s, one = np.arange(n) / RATE_HZ, np.ones(n)
    with pytest.raises(InputError, match="does not move"):
        flow_curve(recording("r", time_s, {"command [%]": one, "flow [l/min]": one}), "command", "flow")
    up = np.linspace(-100, 100, n)
    with pytest.raises(InputError, match="both up and down"):
        flow_curve(recording("r", time_s, {"command [%]": up, "flow [l/min]": up}), "command", "flow")
    dead = triangle(-10.0, 10.0, 40.0, RATE_HZ)
    columns = {"command [%]": dead, "flow [l/min]": 1e-3 * np.sin(np.arange(len(dead)))}
    with pytest.raises(InputError, match="no flow beyond the noise"):
        flow_curve(recording("r", np.arange(len(dead)) / RATE_HZ, columns), "command", "flow")
