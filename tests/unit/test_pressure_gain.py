"""Pressure gain of load pressures by formula."""

import numpy as np
import pytest
from swept_recording import swept_recording

from hil.units import convert
from procedures.pressure_gain import KIND, evaluate

SUPPLY_BAR = 70.0


def found(gain=50.0, null=0.3, late=0.0, seed=0, top=95.0, unit="bar"):
    """A load pressure that is straight within ± 60 % of supply and bends to its end beyond."""

    def load(command, _k):
        shifted = command - late * np.sign(np.gradient(command))
        percent = gain * (shifted - null)
        size = np.abs(percent)
        bent = np.where(size <= 60.0, size, 60.0 + (top - 60.0) * np.tanh((size - 60.0) / (top - 60.0)))
        return SUPPLY_BAR / 100.0 * np.sign(percent) * bent

    channels = {
        "load pressure": ("bar", load, 0.2),
        "supply pressure": (unit, lambda command, _k: np.full(len(command), convert(SUPPLY_BAR, "bar", unit)), 0.2),
    }
    findings = evaluate(swept_recording(KIND, [(-5.0, 5.0, 40.0), (-5.0, 5.0, 80.0)], channels, seed=seed))
    return findings, {one.name: one for one in findings.measured}


@pytest.mark.parametrize("gain", [50.0, -50.0])
@pytest.mark.parametrize("late", [0.0, 0.05])
def test_the_slope_within_40_percent_of_supply_holds_the_truth_and_no_lag(gain, late):
    for seed in range(3):
        _, one = found(gain=gain, late=late, seed=seed)
        assert one["pressure_gain"].value == pytest.approx(gain, abs=3.0 * one["pressure_gain"].std)
        assert one["pressure_gain"].std < 0.003 * abs(gain)
        assert one["pressure_null"].value == pytest.approx(0.3, abs=3.0 * one["pressure_null"].std)
        assert one["pressure_null"].std < 0.01
        assert one["supply_pressure"].value == pytest.approx(SUPPLY_BAR, abs=0.01)


def test_a_supply_pressure_that_is_read_in_psi_counts_in_bar():
    _, one = found(unit="psi")
    assert one["supply_pressure"].value == pytest.approx(SUPPLY_BAR, abs=0.01)
    assert one["pressure_gain"].value == pytest.approx(50.0, rel=0.01)


def test_a_load_pressure_that_stays_below_40_percent_has_no_gain():
    findings, one = found(gain=6.0)
    assert one["pressure_gain"].value is None
    assert str(findings.notes[0]).startswith("The load pressure does not pass ± 40 % of the supply pressure.")
