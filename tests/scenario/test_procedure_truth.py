"""What the procedures find on the simulated HPV41 is what its physics says, within the stated uncertainty."""

import numpy as np
import pytest

from hil.identification.frequency.measuring_chain import MeasuringChain
from hil.identification.frequency.sine_test import sine_test
from hil.physics.compose import plant
from hil.physics.published import tordal
from hil.session.procedure import load_procedure
from tests.bench_files import bench_file
from tests.driven import driven

BENCH = "brevini-hpv41"
VALVE = plant(BENCH)
TRUTH = VALVE.typical
RATE_HZ = 1000.0
SENSOR = MeasuringChain(sensor_lag_s=TRUTH["sensor_lag"])


@pytest.fixture
def measure(tmp_path):
    """Findings of a procedure on the bench, without a report."""

    def run(name, bench=BENCH, **given):
        procedure = load_procedure(name)
        return procedure.evaluate(driven(procedure, bench, tmp_path / name, given))

    return run


def described(frequencies, amplitude, bias):
    """The describing function of the plant without noise, its flow meter taken out."""
    return sine_test(frequencies, amplitude, bias).response(VALVE, TRUTH) / SENSOR.at(np.array(frequencies))


def near(measured, truth, *, factor=4.0):
    assert abs(measured.value - truth) < factor * measured.std, (measured.name, measured.value, measured.std, truth)


def by_name(findings):
    return {measured.quantity: measured for measured in findings.measured}


def test_stepped_sines_give_the_describing_function_dead_time_and_bandwidths(measure):
    frequencies = (0.1, 0.3, 0.7, 1.1, 1.5, 1.9, 2.5, 3.3, 4.1, 4.9)
    findings = measure("frequency_response", frequencies=frequencies, amplitudes="10", biases="50,-50")
    for curve, bias in zip(findings.curves["responses"], (50.0, -50.0), strict=True):
        truth = described(frequencies, 10.0, bias)
        off = np.concatenate((
            (curve["gain"] - np.abs(truth)) / curve["gain_std"],
            (curve["phase_deg"] - np.degrees(np.unwrap(np.angle(truth)))) / curve["phase_std_deg"],
        ))  # fmt: skip
        assert np.max(np.abs(off)) < 4.5
        assert 0.4 < np.sqrt(np.mean(off**2)) < 1.6
        model = curve["model"]
        assert abs(model["dead_time_s"] - TRUTH["dead_time"]) < 4.0 * model["dead_time_std_s"]
        assert model["fit_percent"] > 99.0
        assert [overlay["frequency_hz"] for overlay in curve["overlays"]] == [0.1, 1.9, 4.9]
        for overlay in curve["overlays"]:
            assert np.std(overlay["measured"] - overlay["fitted"]) < 0.35
    grid = np.linspace(0.1, 3.0, 30)
    fine = described(tuple(grid), 10.0, 50.0)
    measured = by_name(findings)
    down_3db = np.interp(3.0, -20.0 * np.log10(np.abs(fine / fine[0])), grid)
    near(measured["bandwidth_3db"], float(down_3db), factor=6.0)  # the crossing is read from a line, not a spline
    assert measured["thd"].value < 3.0


def test_responses_of_one_valve_have_one_form_whose_dead_times_hold_the_truth(measure):
    # friction bends each amplitude in another way: alone, each response would choose a form of its own
    findings = measure(
        "frequency_response", "hpv41-identified", amplitudes="5,10,20", biases="50,-50", measure_periods="2"
    )
    models = [curve["model"] for curve in findings.curves["responses"]]
    assert {(*map(str, model["coefficients"]),) for model in models} == {("b0", "a2", "a1", "a0", "dead_time_s")}
    truth_s = tordal.valve().values["dead_time"]
    off = [abs(model["dead_time_s"] - truth_s) / model["dead_time_std_s"] for model in models]
    assert max(off) < 2.5 and np.sqrt(np.mean(np.square(off))) < 1.5
    assert sum("these lines alone ask for another" in note for note in findings.notes) >= 2


def test_a_zero_in_the_right_half_plane_is_told_for_the_dead_time_that_it_is(measure):
    findings = measure(
        "frequency_response", frequencies="0.1,0.5,1,2,3,4.9", amplitudes="10", biases="50", zeros="1", dead_time="no"
    )
    (curve,) = findings.curves["responses"]
    assert any(
        "in the right half plane" in note and "held-out lines prefer the dead time" in note for note in findings.notes
    )
    found = curve["alternative"]
    assert abs(found["dead_time_s"] - TRUTH["dead_time"]) < 4.0 * found["dead_time_std_s"]
    assert found["fit_percent"] > curve["model"]["fit_percent"]


def test_what_did_not_become_steady_in_time_is_measured_all_the_same_and_told(measure):
    findings = measure("frequency_response", frequencies="0.4,1,2", amplitudes="40", longest_wait_s="0", measure_s="0")
    assert any(
        text.startswith("Measured before the response was steady: 0.4 Hz at +50") for text in findings.deviations
    )
    assert any("distortion above 5 %" in note for note in findings.notes)


def test_without_correction_the_chain_is_a_deviation(measure):
    findings = measure("frequency_response", frequencies="0.4,1,2", amplitudes="10", biases="50", correct_chain="no")
    assert any(
        "The measuring chain changes the response by more than 1 % from 0.4 Hz on" in d for d in findings.deviations
    )


def test_a_multisine_agrees_with_the_sines_and_sees_the_curved_edge_as_even_distortion(measure):
    findings = measure("multisine_response", amplitudes="10", biases="50")
    (curve,) = findings.curves["responses"]
    truth = described(tuple(curve["frequency_hz"]), 5.0, 50.0)
    assert np.max(np.abs(curve["gain"] / np.abs(truth) - 1.0)) < 0.05
    assert np.max(np.abs(curve["phase_deg"] - np.degrees(np.unwrap(np.angle(truth))))) < 3.0
    measured = by_name(findings)
    noise = measured["noise"]
    assert abs(noise.value - 0.398) < 2.0 * noise.std  # of the bench's instruments, over the median amplitude
    assert measured["even_distortion"].value > 2.0 * noise.value
    assert measured["odd_distortion"].value < measured["even_distortion"].value / 2.0


def test_the_flow_curve_has_the_dead_band_the_rated_flow_and_no_hysteresis(measure):
    findings = measure("flow_curve")
    measured = by_name(findings)
    near(measured["dead_band_positive"], TRUTH["dead_band"])
    near(measured["dead_band_negative"], -TRUTH["dead_band"])
    near(measured["response_high"], TRUTH["full_flow"])
    near(measured["response_low"], -TRUTH["full_flow"])
    near(measured["leakage"], 0.0)
    assert measured["hysteresis"].value < 0.1
    delays = ("dead_time", "sensor_lag")
    spool_s = 2.0 * TRUTH["spool_damping"] / TRUTH["spool_frequency"]
    near(measured["lag"], 1e3 * (sum(TRUTH[d] for d in delays) + 1.0 / TRUTH["pilot_rate"] + spool_s + 0.5 / RATE_HZ))
    curve = findings.curves["flow_curve"]
    over = np.maximum(np.abs(curve["command"]) - TRUTH["dead_band"], 0.0) / (100.0 - TRUTH["dead_band"])
    flow = np.sign(curve["command"]) * TRUTH["full_flow"] * over ** TRUTH["curve_exponent"]
    assert np.max(np.abs(curve["spline"] - flow)) < 0.6
    assert np.all(np.diff(curve["spline"]) >= 0.0)


def test_a_valve_with_play_shows_its_hysteresis_and_its_lag_apart(measure, tmp_path):
    effect = {"name": "backlash", "hook": "opening", "parameters": {"half_width": 2.0}}
    worn = bench_file(tmp_path / "worn.toml", BENCH, simulation={"effects": [effect]})
    measured = by_name(measure("flow_curve", worn, cycle_s=40))
    assert measured["hysteresis"].value == pytest.approx(2.0, abs=0.15)  # 4 % of 200 %
    assert measured["lag"].value == pytest.approx(202.0, abs=8.0)


def test_a_step_that_does_nothing_is_told_and_the_others_are_kept(measure):
    findings = measure("step_response", levels="0,10,80")
    assert [curve["label"] for curve in findings.curves["steps"]] == ["10 → 80 %"]
    assert "0 → 10 %: no figures: the response does not follow it beyond the noise." in findings.notes
    assert all(note.startswith("10 → 80 %") for note in findings.notes if not note.startswith("0 → 10 %"))
