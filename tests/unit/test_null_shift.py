"""Null shift of flows by formula: each condition moves the null by so much."""

import numpy as np
import pytest
from swept_recording import swept_recording

from procedures.null_shift import KIND, evaluate

USUAL = {"supply pressure": 70.0, "tank pressure": 2.0, "oil temperature": 40.0}
WAYS = [{}, {"supply pressure": 56.0}, {"supply pressure": 84.0}, {"tank pressure": 9.0}, {"oil temperature": 20.0},
        {"oil temperature": 60.0}]  # fmt: skip
PER_BAR, PER_TANK_BAR, PER_K = 0.02, -0.03, 0.04


def found(seed=0, ways=WAYS):
    at = [{**USUAL, **way} for way in ways]

    def null(one):
        return (0.5 + PER_BAR * (one["supply pressure"] - 70.0) + PER_TANK_BAR * one["tank pressure"]
                + PER_K * (one["oil temperature"] - 40.0))  # fmt: skip

    def standing(role):
        return lambda command, k: np.full(len(command), at[k][role])

    channels = {
        "flow": ("l/min", lambda command, k: 0.28 * (command - null(at[k])), 0.05),
        "supply pressure": ("bar", standing("supply pressure"), 0.2),
        "return pressure": ("bar", standing("tank pressure"), 0.02),
        "oil temperature": ("degC", standing("oil temperature"), 0.0),
    }
    more = [{"label": f"way {k}", "at": one} for k, one in enumerate(at)]
    findings = evaluate(swept_recording(KIND, [(-100.0, 100.0, 20.0)] * len(ways), channels, more, seed))
    return findings, {one.name: one for one in findings.measured}


def test_each_shift_holds_the_truth_for_the_change_that_its_definition_names():
    for seed in range(3):
        _, one = found(seed)
        for name, truth in (("supply", 7.0 * PER_BAR), ("tank", 7.0 * PER_TANK_BAR), ("temperature", 40.0 * PER_K)):
            shift = one[f"null_shift_{name}"]
            assert shift.value == pytest.approx(truth, abs=3.5 * shift.std), name
            assert shift.std < 0.05
        for end in ("high", "low"):
            flow = one[f"flow_shift_temperature, {end}"]
            assert flow.value == pytest.approx(-0.28 * 40.0 * PER_K, abs=3.5 * flow.std)
            assert flow.std < 0.05
        assert one["null, way 0"].value == pytest.approx(0.5 + 2.0 * PER_TANK_BAR, abs=0.1)


def test_the_line_and_the_nulls_over_a_condition_go_to_the_page():
    findings, one = found()
    supply, tank, oil = findings.curves["null_shift"]
    assert supply["condition"] == pytest.approx([56.0, 70.0, 84.0], abs=0.02)
    slope = np.polyfit(supply["condition"], supply["fitted"], 1)[0]
    assert slope * 7.0 == pytest.approx(one["null_shift_supply"].value, rel=1e-3)
    assert (len(tank["condition"]), oil["condition_unit"]) == (2, "degC")


def test_a_condition_that_was_never_adjusted_has_no_shift():
    one = found(ways=[{}])[1]
    assert one["null_shift_supply"].value is None and one["flow_shift_temperature, high"].value is None
