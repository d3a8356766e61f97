"""A measured flow curve and a transfer function as one model: its table, its dynamics, and what it refuses."""

import math

import numpy as np
import pytest

import hil
from hil.errors import FileError, InputError
from hil.identification.papers.curve_model import curve_model, table_nodes, with_measured_curve
from hil.identification.steady.flow_curve import spline
from hil.physics.measured_curve import NODES
from hil.physics.model import typical_model
from hil.physics.published import tordal
from hil.physics.simulate import Drive, simulate
from hil.physics.transfer_function import transfer_function
from hil.record.recording import recording
from hil.session.analyses import flow_curve_of

COMMAND = np.array([-100.0, -80.0, -60.0, -40.0, -20.0, 0.0, 20.0, 40.0, 60.0, 80.0, 100.0])
FLOW = np.sign(COMMAND) * 70.0 * np.maximum(np.abs(COMMAND) - 20.0, 0.0) / 80.0
HEADINGS = ("command [%]", "flow [l/min]")
MODELS = [f"hpv41-{side}-{size}" for side in ("plus", "minus") for size in (5, 10, 20)]


def answered(model, command):
    time_s = np.arange(len(command)) / 1000.0
    return hil.simulate(model, recording("r", time_s, {HEADINGS[0]: command})).values("flow")


def test_at_rest_it_is_the_curve():
    model = curve_model(COMMAND, FLOW, tordal.MEAN_MODEL, *HEADINGS)
    levels = np.array([-120.0, -70.0, -10.0, 0.0, 15.0, 33.0, 100.0])
    rest = np.array([answered(model, np.full(4000, level))[-1] for level in levels])
    assert rest == pytest.approx(spline(COMMAND, FLOW)(np.clip(levels, -100.0, 100.0)), abs=0.05)
    assert rest[0] == pytest.approx(-70.0)  # beyond its ends it stays


def test_small_steps_are_those_of_the_transfer_function():
    model = curve_model(COMMAND, FLOW, tordal.MEAN_MODEL, *HEADINGS)
    command = np.concatenate((np.full(200, 60.0), np.full(1500, 61.0)))
    answer = answered(model, command)
    moved = answer[200:] - answer[0]
    linear = transfer_function(tordal.MEAN_MODEL.numerator / tordal.MEAN_MODEL.dc_gain, tordal.MEAN_MODEL.denominator)
    expected = 0.875 * linear.step(np.arange(1500) / 1000.0)  # slope of the curve
    assert moved == pytest.approx(expected, abs=1e-3)
    assert moved.min() < -0.01  # the zero in the right half plane goes the wrong way first


def test_table_follows_a_smooth_curve_and_needs_few_nodes_for_a_straight_one():
    smooth = 70.0 * np.tanh(COMMAND / 50.0)
    at = table_nodes(COMMAND, smooth)
    fine = np.linspace(-100.0, 100.0, 500)
    curve = spline(COMMAND, smooth)
    assert len(at) == NODES
    assert np.abs(np.interp(fine, at, curve(at)) - curve(fine)).max() < 0.005 * 140.0
    assert len(table_nodes(np.array([0.0, 1.0]), np.array([0.0, 2.0]))) == 2


def test_a_falling_curve_falls():
    model = curve_model(COMMAND, -FLOW, tordal.MEAN_MODEL, *HEADINGS)
    assert answered(model, np.full(4000, 100.0))[-1] == pytest.approx(-70.0)


@pytest.mark.parametrize(
    ("command", "linear", "said"),
    [
        (COMMAND[::-1], tordal.MEAN_MODEL, "each above the one before"),
        (COMMAND, transfer_function([1.0], np.poly([-1, -2, -3, -4])), "up to three poles"),
        (COMMAND, transfer_function([1.0], [1.0, 1.0, 0.0]), "no integrator"),
    ],
)
def test_what_it_cannot_be_is_refused(command, linear, said):
    with pytest.raises(InputError, match=said):
        curve_model(command, FLOW, linear, *HEADINGS)


def test_branches_of_a_table_are_averaged(tmp_path):
    path = tmp_path / "curve.csv"
    path.write_text("command [%],rising [l/min],falling [l/min],std [l/min]\n50,20,30,1\n-50,-30,-20,1\n")
    found = flow_curve_of(path)
    assert found.command.tolist() == [-50.0, 50.0]
    assert found.flow.tolist() == [-25.0, 25.0]
    path.write_text("nothing here\n")
    with pytest.raises(FileError, match="not a flow curve"):
        flow_curve_of(path)


def test_figure_17_from_the_six_published_responses(tmp_path, prints):
    rows = "".join(f"{u},{q}\n" for u, q in zip(COMMAND, FLOW, strict=True))
    (tmp_path / "curve.csv").write_text(f"{','.join(HEADINGS)}\n{rows}")
    options = ("--weights", "uniform", "--out", tmp_path / "m.json")
    out = prints("analyse", "compose", tmp_path / "curve.csv", *MODELS, *options)
    assert "(−145 s + 5993) / (s³ + 36.68 s² + 1046 s + 6009)" in out
    by_hand = hil.compose(tmp_path / "curve.csv", tordal.MEAN_MODEL.to_model("r [l/min]", "q [l/min]"))
    assert hil.load_model(tmp_path / "m.json").values == pytest.approx(by_hand.values, rel=1e-3, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "measured", "levels", "unit", "size"),
    [
        ("cummins-efc", "efc-measured", (1.2, 2.0), "mA", 1e3),
        ("brevini-hpv41", "hpv41-measured", (-100.0, 100.0), "%", 1.0),
    ],
)
def test_a_measured_curve_takes_the_place_of_the_law_and_leaves_the_dynamics(name, measured, levels, unit, size):
    valve = typical_model(name)

    def played(model, command):
        return simulate(model.definition, model.values, Drive(command[None, :], math.nan, 2e-3))[0]

    at = np.linspace(*levels, 200)
    steady = np.array([played(valve, np.full(2, level))[-1] for level in at])
    made = with_measured_curve(size * at, steady, valve, unit, valve.definition.output.unit)
    assert made.plant == measured
    assert made.parameters["dead_time"] == valve.parameters["dead_time"]
    assert made.values["command_1"] == pytest.approx(levels[0])
    command = np.concatenate((np.full(50, levels[0]), np.linspace(*levels, 300), np.full(50, levels[1])))
    truth = played(valve, command)
    np.testing.assert_allclose(played(made, command), truth, atol=5e-3 * np.ptp(truth))


def test_a_curve_stands_in_no_other_plant():
    with pytest.raises(InputError, match=r"linear-axis: no measured curve can stand in it"):
        with_measured_curve(COMMAND, FLOW, typical_model("linear-axis"), "N", "m")
