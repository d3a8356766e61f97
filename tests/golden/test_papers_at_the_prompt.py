"""The papers' own calculations at the prompt: their printed numbers go in, or come out."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

import hil
from hil.physics.model import typical_model
from hil.physics.published import gunay, tordal, tugsal
from hil.physics.transfer_function import from_parameters
from hil.record.recording import recording
from hil.record.table.response_table import ResponseTable, write_response_table
from hil.session.analyses import corners_of
from hil.signals.interval import COVERED


def functions(found):
    return {one["label"]: (one["numerator"], one["denominator"]) for one in found["models"]}


def test_equations_11_to_22_of_the_hpv41_paper(command_line):
    times = ("--rise", tordal.RISE_S, "--settling", tordal.SETTLING_S)
    status, out, _ = command_line("analyse", "step", *times, "--beside", "hpv41-plus-10", "--json")
    (found,) = json.loads(out)
    roots = sorted((root["re"], abs(root["im"])) for root in found["damping_roots"])
    assert status == 0
    assert np.array(roots) == pytest.approx(
        np.array([(-0.9097, 0), (0.22559, 1.1264), (0.22559, 1.1264), (0.69545, 0)]), abs=1e-4
    )
    made = functions(found)
    assert made["first order, from the rise"][0] == pytest.approx([4.889], abs=1e-3)
    assert made["first order, from settling"][0] == pytest.approx([3.265], abs=1e-3)
    assert made["second order"][1] == pytest.approx([1.0, 6.5306, 22.045], abs=1e-3)
    top, below = made["third order, fitted to the response"]
    assert top == pytest.approx(tordal.THIRD_ORDER.numerator, rel=1e-4)
    assert below == pytest.approx(tordal.THIRD_ORDER.denominator, rel=1e-4)
    assert "dead time of 0.424 s" in found["notes"][0]


def test_step_of_a_run_has_its_models_beside_the_response(command_line, tmp_path):
    run = tmp_path / "run"
    settings = ("--set", "beside=hpv41-plus-10", "--set", "levels=0,80")
    assert command_line("run", "step_response", "--bench", "hpv41-plus-10", *settings, "--out", run)[0] == 0
    found = {one.name.rpartition("models, ")[2]: one for one in hil.results(run).transfer_functions}
    # rise 0.349 s and settling 0.703 s of the published model
    assert found["first order, from the rise"].numerator == pytest.approx([2.2 / 0.349], rel=0.01)
    assert found["first order, from settling"].numerator == pytest.approx([4.0 / 0.703], rel=0.02)
    assert found["second order"].covariance[0][0] > 0.0
    assert found["third order, fitted to the response"].numerator == pytest.approx([-150.8, 6361.0], rel=1e-3)
    page = (run / "report.html").read_text("utf-8")
    assert "Models from rise and settling time" in page
    assert "models of the step beside the measured frequency response" in page
    # the same from the run's samples, as from anybody's
    again = json.loads(command_line("analyse", "step", run, "--json")[1])
    assert functions(again[0])["second order"][1] == pytest.approx(list(found["second order"].denominator), rel=1e-3)


def test_equation_12_of_the_sp08_47c_paper(command_line, tmp_path):
    closed = gunay.CLOSED_LOOP_EQ_11
    numbers = [",".join(map(str, row.tolist())) for row in (closed.numerator, closed.denominator)]
    options = ("--numerator", numbers[0], "--denominator", numbers[1])
    status, out, _ = command_line("analyse", "loop", *options, "--out", tmp_path / "open.json", "--json")
    found = json.loads(out)
    assert status == 0
    assert found["denominator"] == pytest.approx(gunay.OPEN_LOOP_EQ_12.denominator)
    assert [pole["re"] for pole in found["unstable_poles"]] == pytest.approx([0.1937], abs=5e-5)
    assert "run away" in found["notes"][0]
    (handed_on,) = json.loads((tmp_path / "open.json").read_text("utf-8"))["transfer_functions"]
    assert handed_on["numerator"] == pytest.approx([0.7837])
    assert command_line("analyse", "loop")[0] == 2


def example(command):
    """The example of section 3.2.2.2, driven."""
    output = np.zeros(len(command))
    top, below = tugsal.EXAMPLE.numerator, tugsal.EXAMPLE.denominator
    for k in range(len(command)):
        output[k] = sum(b * command[k - i] for i, b in enumerate(top) if k >= i)
        output[k] -= sum(a * output[k - i] for i, a in enumerate(below) if i and k >= i)
    return output


@pytest.fixture
def sine(tmp_path):
    time_s = np.arange(1000.0)
    command = np.sin(0.3 * time_s)
    path = tmp_path / "sine.csv"
    hil.write(recording("sine", time_s, {"command [1]": command, "response [1]": example(command)}), path)
    return path


def test_table_3_1_the_sine_finds_what_the_thesis_found(command_line, sine, tmp_path):
    options = ("--poles", 4, "--inputs", 3, "--difference", "--exponential", "--prior", 200**0.5)
    path = tmp_path / "path.csv"
    status, out, _ = command_line("analyse", "recursive", sine, *options, "--path", path, "--json")
    found = json.loads(out)
    assert status == 0
    expected = [-0.0406, 0.3015, -0.0279, -0.4687, 0.0008, 0.0474, 0.9178]
    assert [one["value"] for one in found["parameters"]] == pytest.approx(expected, abs=2e-3)
    assert found["excitation_order"] == 2 and found["asked"] == 7 and found["informed"] < 7
    assert len(hil.read(path)) == 1000


def test_table_3_2_the_step_is_exact(command_line, tmp_path):
    command = np.ones(1000)
    path = tmp_path / "step.csv"
    hil.write(recording("s", np.arange(1000.0), {"u [1]": command, "y [1]": example(command)}), path)
    options = ("--poles", 4, "--inputs", 3, "--difference", "--prior", 1e4, "--input", "u", "--output", "y")
    found = json.loads(command_line("analyse", "recursive", path, *options, "--json")[1])
    assert [one["value"] for one in found["parameters"]] == pytest.approx([0, 0.3, 0, -0.5, 0.001, 0, 1], abs=1e-4)


def test_corners_of_the_good_valve_from_its_magnitude(command_line, tmp_path):
    frequency_hz = np.geomspace(0.1, 20.0, 60)
    response = tugsal.FREQUENCY_MODELS["good"].reduced(0.7).at(frequency_hz)
    path = tmp_path / "good.csv"
    write_response_table(ResponseTable("good", frequency_hz, response, in_db=True), path)
    status, out, _ = command_line("analyse", "corners", path, "--poles", 3, "--zeros", 1, "--json")
    found = json.loads(out)
    assert status == 0
    assert found["poles_rad_s"] == pytest.approx([6.125, 10.0, 10.0], rel=0.02)
    assert found["zeros_rad_s"] == pytest.approx([13.125], rel=0.02)


def test_corners_have_intervals_that_hold_them_and_none_where_two_lie_together():
    frequency_hz, poles = np.geomspace(0.1, 20.0, 40), np.array([3.0, 40.0])
    s, held = 2j * np.pi * frequency_hz, 0
    for seed in range(40):
        noisy = np.exp(0.01 * np.random.default_rng(seed).standard_normal(40)) / ((1.0 + s / 3.0) * (1.0 + s / 40.0))
        found = corners_of(ResponseTable("own", frequency_hz, noisy), 2)
        held += int(np.sum(np.abs(found.poles_rad_s - poles) <= COVERED * found.pole_stds))
    assert 70 <= held <= 80 and np.all(found.pole_stds < 0.1 * poles)
    twins = np.exp(0.01 * np.random.default_rng(0).standard_normal(40)) / (1.0 + s / 30.0) ** 3
    assert np.sum(np.isinf(corners_of(ResponseTable("own", frequency_hz, twins), 3).pole_stds)) >= 2


def test_error_of_equation_4_1_and_its_class(command_line, tmp_path):
    time_s = np.arange(1000) / 1000.0
    for name, psi in (("good", 120.0), ("worn", 120.05)):
        hil.write(recording(name, time_s, {"pressure [psi]": np.full(1000, psi)}), tmp_path / f"{name}.csv")
    options = ("--reference", tmp_path / "good.csv", "--level", "low")
    status, out, _ = command_line("analyse", "error", tmp_path / "worn.csv", *options)
    assert status == 0
    assert "eq. 4.1 1.581, rms 0.05 psi" in out
    assert "severely malfunctioned" in out
    assert "over 1 s at 1000 Hz" in out
    assert "not published" in out
    refused = ("analyse", "error", tmp_path / "worn.csv", "--reference", tmp_path / "good.csv", "--level", "x")
    assert command_line(*refused)[0] == 2


# -- linearisation, eqs 3 to 6 of the SP08-47C paper ---------------------------------------------------------

PLAIN = ("--set", "hysteresis=0", "--set", "coulomb=0", "--poles", 2, "--zeros", 0)


def linear(command_line, *arguments):
    status, out, _ = command_line("linearise", *arguments, "--json")
    assert status == 0
    return json.loads(out)


def test_a_linear_plant_is_linearised_to_itself(command_line):
    found = linear(command_line, "hpv41-plus-10", "--at", 50, "--poles", 3, "--zeros", 1)
    run = tordal.RUNS[1].transfer_function
    assert found["numerator"] == pytest.approx(run.numerator, rel=5e-3)
    assert found["denominator"] == pytest.approx(run.denominator, rel=5e-3)
    assert found["uneven"] < 1e-6


def test_both_directions_of_the_cylinder_have_their_own_function(command_line, tmp_path):
    out, back = (
        linear(command_line, "hydraforce-open-loop", "--at", at, *PLAIN, "--out", tmp_path / f"{at}.json")
        for at in (0.75, -0.75)
    )
    rates = [one["numerator"][-1] / one["denominator"][-2] for one in (out, back)]  # mm/s per A
    assert [one["denominator"][-1] for one in (out, back)] == [0.0, 0.0]  # an integrator
    for one, name in ((out, "extending"), (back, "retracting")):
        shipped = from_parameters(hil.load_model(Path(f"hydraforce-{name}")).values)
        assert one["numerator"] == pytest.approx(shipped.numerator, rel=5e-3)
        assert one["denominator"] == pytest.approx(shipped.denominator, rel=5e-3)
    # at constant pressure it extends faster, by the root of the area ratio
    assert rates[0] / rates[1] == pytest.approx(gunay.CYLINDER.area_ratio**0.5, rel=0.02)
    assert hil.load_model(tmp_path / "0.75.json").values["integrator_gain"] == pytest.approx(rates[0], rel=1e-6)


def test_flow_gain_and_flow_pressure_gain_follow_equations_3_and_4(command_line):
    # q = 11.4 l/min · x · √((Ps − P_L)/2/35 bar), half open, at 100 bar and a load of 40 bar
    at = ("--at", 0.75, "--load-pressure", 40)
    gains = linear(command_line, "hydraforce-open-loop", *at, *PLAIN)["gains"]
    assert gains["K_q"]["value"] == pytest.approx(0.114 * (60 / 70) ** 0.5, rel=1e-4)
    assert gains["K_c"]["value"] == pytest.approx(11.4 * 0.5 * (60 / 70) ** 0.5 / 120, rel=1e-4)
    assert gains["K_c"]["unit"] == "(l/min)/bar"
    # the spool travels 100 % over the current's range beyond the first flow
    spool = 100.0 / typical_model("hydraforce-open-loop").values["flow_range"]
    assert gains["K_q per A"] == {"value": pytest.approx(gains["K_q"]["value"] * spool), "unit": "(l/min)/A"}
    compensated = linear(command_line, "brevini-hpv41", "--at", 50)["gains"]
    assert compensated["K_c"]["value"] == 0.0


@pytest.mark.parametrize(("plant", "at"), [("cummins-efc", 1.6), ("efc-drive", 1.5)])
def test_a_blocked_efc_has_the_pressure_gain_of_equations_2_15_to_2_17(command_line, plant, at):
    found = linear(command_line, plant, "--at", at, "--step", 1e-3)
    values = typical_model(plant).values
    if plant == "cummins-efc":  # P = span / (1 + e^(-(x - centre) / width))
        share = 1.0 / (1.0 + math.exp(-(at - values["curve_centre"]) / values["curve_width"]))
        slope = values["pressure_span"] * share * (1.0 - share) / values["curve_width"]
        assert found["gains"]["K_1/K_2"] == {"value": pytest.approx(slope, rel=1e-3), "unit": "psi/A"}
    at_rest = found["numerator"][-1] / found["denominator"][-1]  # x is the current itself there
    assert found["gains"]["K_1/K_2"]["value"] == pytest.approx(at_rest, rel=0.01)


def test_a_plant_that_no_linear_model_fits_is_said_to_be_none(command_line):
    sticking = json.loads(command_line("linearise", "hydraforce-open-loop", "--at", 1.0, "--json").out)
    assert sticking["fit_percent"] < 80.0  # how far below is a question of the last digit: several forms fail alike
    assert sticking["notes"][-1].endswith("where 80 % are asked for")
    assert json.loads(command_line("linearise", "brevini-hpv41", "--at", 30, "--json").out)["notes"] == []


def test_a_command_beyond_the_full_scale_is_said(command_line):
    for at, said in (
        (100, []),
        (1e9, ["1e+09 % lies beyond the full scale of 100 %, where nobody knows the plant"]),
    ):
        assert linear(command_line, "brevini-hpv41", "--at", at)["notes"] == said


def test_what_does_not_answer_is_not_linearised(command_line):
    status, _, text = command_line("linearise", "hydraforce-open-loop", "--at", 0.1)
    assert status == 2
    assert "dead band" in text
    assert command_line("linearise", "hydraforce-open-loop", "--at", 0.75, "--set", "nothing=0")[0] == 2
    for option, value in (("--step", 0), ("--step", "nan"), ("--load-pressure", "inf")):
        told = command_line("linearise", "brevini-hpv41", "--at", 30, option, value)
        assert told.status == 2 and f"{option} {value}: a finite number" in told.err
    assert "allowed are 0 … 0.2" in command_line("linearise", "brevini-hpv41", "--at", 30, "--set", "dead_time=nan").err
