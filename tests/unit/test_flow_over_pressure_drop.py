"""Flow over pressure drop of flows by formula."""

import pytest
from supply_recording import supply_recording

from procedures.flow_over_pressure_drop import evaluate

SUPPLIES = (35.0, 52.5, 70.0, 105.0, 140.0)


def found(exponent=0.5, seed=0, supplies=SUPPLIES, **more):
    findings = evaluate(supply_recording(lambda drop: 28.0 * (drop / 70.0) ** exponent, supplies, seed, **more))
    return findings, {one.name: one for one in findings.measured}


@pytest.mark.parametrize("exponent", [0.5, 0.62])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_exponent_and_rated_flow_hold_the_truth(exponent, sign):
    label = f"{100 * sign:+.0f} %"
    for seed in range(3):
        _, one = found(exponent, seed)
        power, rated = one[f"flow_exponent, {label}"], one[f"rated_flow, {label}"]
        assert power.value == pytest.approx(exponent, abs=3.0 * power.std)
        assert power.std < 0.001
        assert rated.value == pytest.approx(sign * 28.0, abs=3.0 * rated.std)
        assert one[f"pressure_drop, {label}, supply 70 bar"].value == pytest.approx(65.0, abs=0.06)


def test_a_transducer_that_is_off_by_what_its_calibration_allows_stays_within_the_uncertainty():
    _, one = found(uncertainty=2.0, off=1.0)
    power = one["flow_exponent, +100 %"]
    assert abs(power.value - 0.5) > 5.0 * power.repeatability
    assert abs(power.value - 0.5) < 1.5 * power.std


def test_a_rated_drop_outside_what_was_driven_is_said_and_two_points_are_no_law():
    findings, _ = found(rated=200.0)
    assert "+100 %: the rated pressure drop, 200 bar, is outside what was driven, 30 … 135 bar." in findings.notes
    assert found(supplies=(35.0, 70.0))[1]["flow_exponent, +100 %"].value is None
