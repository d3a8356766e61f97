"""Transfer functions and parameters for other tools, read back by each of them as far as it is at hand."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from hil.errors import InputError, SettingError
from hil.exports.compensation import compensation
from hil.exports.function import function_of
from hil.exports.texts import functions_text, model_text
from hil.findings.results import FittedFunction
from hil.identification.papers.linearise import linearised
from hil.identification.steady.flow_curve import monotone
from hil.physics.model import Covariance, Value, typical_model
from hil.physics.transfer_function import transfer_function
from hil.session.export import Simulation, exported

NUMERATOR, DENOMINATOR = (-69.8, 6114.5), (1.0, 40.02, 1253.2, 7145.8)
FITTED = FittedFunction(
    name="+50 ± 20 %", numerator=NUMERATOR, denominator=DENOMINATOR, dead_time_s=0.006, unit="l/min per %",
    coefficients=("b1", "b0", "a2", "a1", "a0", "dead_time_s"),
    covariance=tuple(tuple(row) for row in np.diag([1.0, 4.0, 9.0, 16.0, 25.0, 1e-6]).tolist()),
)  # fmt: skip


@pytest.fixture(scope="module")
def model():
    linear = transfer_function([2.0, 30.0], [1.0, 8.0, 40.0, 60.0], 0.02)
    made = linear.to_model("command [%]", "flow [l/min]")
    return replace(made, covariance=Covariance(("gain", "dead_time"), ((1e-4, 0.0), (0.0, 1e-6))))


def test_export_to_python_runs_and_has_the_same_response():
    control = pytest.importorskip("control")
    scope: dict = {}
    exec(functions_text([FITTED], "python"), scope)
    made = scope["to_control"](FITTED.name, pade_order=5)
    omega = 2.0 * np.pi * np.array([0.1, 1.0, 5.0])
    expected = transfer_function(NUMERATOR, DENOMINATOR, 0.006).at(omega / (2.0 * np.pi))
    np.testing.assert_allclose(control.frequency_response(made, omega).complex.ravel(), expected, rtol=1e-6)


def test_export_to_matlab_is_one_statement_with_every_digit():
    text = functions_text([FITTED], "matlab")
    assert "G1 = tf([-69.8 6114.5], [1.0 40.02 1253.2 7145.8]);\nT1 = 0.006;" in text
    assert "if ~in_octave\n  G1.InputDelay = T1;\nend" in text  # Octave's control package knows no such name
    assert text.isascii() or all(line.startswith("%") for line in text.splitlines() if not line.isascii())


def test_export_to_json_and_csv_carries_the_uncertainties():
    document = json.loads(functions_text([FITTED], "json"))
    assert document["schema"] == "hil.transfer-functions/1"
    assert document["transfer_functions"][0]["covariance"][1][1] == 4.0
    rows = {row["coefficient"]: row for row in csv.DictReader(functions_text([FITTED], "csv").splitlines())}
    assert (float(rows["b0"]["value"]), float(rows["b0"]["std"])) == (6114.5, 2.0)
    assert rows["a3"]["std"] == ""


@pytest.mark.parametrize(
    ("form", "word"),
    [("python", "(SIMULATED)"), ("matlab", "(SIMULATED)"), ("json", '"simulated": true'), ("csv", ",True\n")],
)
def test_export_of_a_simulated_run_says_so(form, word):
    assert word in functions_text([FITTED], form, simulated=True)
    assert word not in functions_text([FITTED], form, simulated=False)


def test_model_of_a_transfer_function_has_its_coefficients(model):
    found = function_of(model, "valve")
    np.testing.assert_allclose(found.numerator, [2.0, 30.0], rtol=1e-9)
    np.testing.assert_allclose(found.denominator, [1.0, 8.0, 40.0, 60.0], rtol=1e-9)
    stds = dict(zip(found.coefficients, np.sqrt(np.diag(np.array(found.covariance))), strict=True))
    assert stds["b0"] == pytest.approx(30.0 * 0.01 / model.values["gain"], rel=1e-4)  # b0 is proportional to the gain
    assert stds["dead_time_s"] == pytest.approx(1e-3)
    assert stds["a0"] == pytest.approx(0.0, abs=1e-6)
    assert found.fit_percent is None
    fitted = replace(model, origin={"fit_percent": {"one": 97.0, "another": 95.5}})
    assert function_of(fitted, "valve").fit_percent == 95.5


def test_bent_model_has_no_transfer_function_and_hands_on_its_parameters(model):
    bent = replace(model, parameters={**model.parameters, "bend": Value(-0.02, "1/[V]")})
    with pytest.raises(InputError, match=r"valve: its static curve is bent \(bend = -0.02\).*hil linearise"):
        function_of(bent, "valve")
    rows = {row["name"]: row for row in csv.DictReader(model_text(bent, "valve", "csv").splitlines())}
    assert float(rows["bend"]["value"]) == -0.02
    slope = linearised(bent, 5.0, step=0.1, window_s=8.0).model.dc_gain
    assert slope == pytest.approx(model.values["gain"] * (1.0 - 2.0 * 0.02 * 5.0), rel=5e-3)


def test_model_of_another_plant_hands_on_its_parameters():
    model = typical_model("brevini-hpv41")
    with pytest.raises(InputError, match="has no transfer function"):
        function_of(model, "valve")
    rows = {row["name"]: row for row in csv.DictReader(model_text(model, "valve", "csv").splitlines())}
    assert (float(rows["full_flow"]["value"]), rows["full_flow"]["unit"]) == (70.0, "l/min")
    scope: dict = {}
    exec(model_text(model, "valve", "python"), scope)
    assert scope["PARAMETERS"]["dead_band"] == (20.0, None, "%")


def test_a_line_reads_with_its_intervals_before_its_formula():
    read, formula = FITTED.line.rsplit("; ", 1)
    assert read.startswith("transfer function: +50 ± 20 %: gain ") and "dead time 0.0060 ± 0.0020 s" in read
    assert formula == FITTED.formula
    plain = FITTED.model_copy(update={"coefficients": (), "covariance": (), "denominator": (*DENOMINATOR, 0.0)})
    assert plain.line == f"transfer function: +50 ± 20 %: {plain.formula}"


COMMAND, FLOW = np.array([-100.0, -60.0, -20.0, 20.0, 60.0, 100.0]), np.array([-50.0, -25.0, 0.0, 0.0, 30.0, 60.0])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_compensation_table_makes_the_curve_straight(sign):
    table = compensation(COMMAND, sign * FLOW, 23)
    given = monotone(COMMAND, sign * FLOW)(table[:, 1])
    np.testing.assert_allclose(given, table[:, 0], atol=0.06)
    np.testing.assert_allclose(np.diff(table[:, 0]), 110.0 / 22)
    assert np.all(sign * np.diff(table[:, 1]) > 0.0)
    at_rest = np.argmin(np.abs(table[:, 0]))
    assert table[at_rest, 1] == pytest.approx(0.0, abs=0.1)  # the middle of the dead band


def test_a_compensation_table_is_written_from_a_run_or_a_csv(tmp_path):
    (tmp_path / "curve.csv").write_text(
        "command [%],flow [l/min]\n" + "".join(f"{u},{y}\n" for u, y in zip(COMMAND, FLOW, strict=True))
    )
    rows = exported(tmp_path / "curve.csv", "table", None, points=12).text.splitlines()
    assert rows[0] == "flow [l/min],command [%],simulated" and len(rows) == 13
    assert rows[1] == "-50.0,-100.0," and rows[-1] == "60.0,100.0,"
    with pytest.raises(InputError, match="a table has at least 2"):
        exported(tmp_path / "curve.csv", "table", None)
    with pytest.raises(SettingError, match="of a run of flow_curve"):
        exported(tmp_path / "model.json", "table", None)
    with pytest.raises(SettingError, match="only of a table"):
        exported(tmp_path / "curve.csv", "json", None, points=3)
    with pytest.raises(InputError, match="does not change"):
        compensation(COMMAND, np.zeros(6), 5)


@pytest.mark.parametrize("how", [{"effects": ["friction@force"]}, {"step_s": 1e-3}, {"platforms": ["win64"]}])
def test_what_is_of_c_and_fmu_alone_is_no_option_of_a_text(model, how):
    with pytest.raises(SettingError, match="to csv: a step, effects and platforms are of C and FMU only"):
        exported(model, "csv", None, how=Simulation(**how))
