"""Limiting power of flows by formula: one that rises on, one that is cut off, one that falls."""

import math
from dataclasses import replace

import numpy as np
import pytest
from supply_recording import supply_recording

from procedures.limiting_power import evaluate

SUPPLIES = (17.5, 35.0, 52.5, 70.0, 87.5, 105.0, 122.5, 140.0)


def orifice(drop):
    return 28.0 * math.sqrt(drop / 70.0)


def closing(drop):
    """By flow forces: its logarithm rises by a quarter of that of the drop at 70 bar."""
    return orifice(drop) / (1.0 + (drop / 70.0) ** 2) ** 0.25


def found(flow, seed=0, supplies=SUPPLIES, **more):
    findings = evaluate(supply_recording(flow, supplies, seed, **more))
    return findings, {one.name: one for one in findings.measured}


@pytest.mark.parametrize("label", ["+100 %", "-100 %"])
def test_the_power_of_an_orifice_is_largest_at_the_highest_supply_and_its_flow_rises_on(label):
    for seed in range(3):
        _, one = found(orifice, seed)
        power, saturated = one[f"limiting_power, {label}"], one[f"saturation_drop, {label}"]
        assert power.value == pytest.approx(orifice(135.0) * 135.0 / 600.0, abs=3.0 * power.std)
        assert power.std < 0.005
        assert one[f"limiting_drop, {label}"].value == pytest.approx(135.0, abs=0.06)
        assert (saturated.relation, saturated.value) == (">", pytest.approx(135.0, abs=0.06))


@pytest.mark.parametrize("kink", [45.0, 56.0, 66.0, 75.0, 90.0])
def test_a_flow_that_is_cut_off_saturates_there_within_the_uncertainty(kink):
    for seed in range(3):
        _, one = found(lambda drop: min(orifice(drop), orifice(kink)), seed)
        saturated = one["saturation_drop, +100 %"]
        assert saturated.relation == "="
        assert saturated.value == pytest.approx(kink, abs=2.0 * saturated.std)
        assert saturated.std < 3.0


def test_a_flow_that_bends_saturates_where_its_slope_is_a_quarter_and_the_power_is_largest_where_it_is():
    _, one = found(closing)
    assert one["saturation_drop, -100 %"].value == pytest.approx(70.0, abs=2.0 * one["saturation_drop, -100 %"].std)
    _, one = found(lambda drop: orifice(drop) / (1.0 + (drop / 60.0) ** 6), supplies=np.arange(20.0, 145.0, 10.0))
    drops = np.arange(15.0, 140.0, 10.0)
    powers = [orifice(drop) / (1.0 + (drop / 60.0) ** 6) * drop / 600.0 for drop in drops]
    assert one["limiting_drop, +100 %"].value == pytest.approx(drops[np.argmax(powers)], abs=0.06)
    assert one["limiting_power, +100 %"].value == pytest.approx(max(powers), rel=2e-3)


def test_a_gauge_that_is_off_is_in_the_uncertainty_of_the_power_and_points_may_come_in_any_order():
    _, one = found(orifice, supplies=SUPPLIES[::-1], uncertainty=2.0, off=1.0)
    power = one["limiting_power, +100 %"]
    off = abs(power.value - orifice(135.0) * 135.0 / 600.0)
    assert 5.0 * power.repeatability < off < 1.5 * power.std


def test_flow_is_converted():
    recording = supply_recording(orifice, SUPPLIES)
    flow = recording.channel("flow")
    litres = replace(flow, unit="m3/h", values=flow.values * 0.06)
    one = evaluate(replace(recording, channels={**recording.channels, "flow": litres})).measured[0]
    assert (one.unit, one.value) == ("kW", pytest.approx(found(orifice)[1][one.name].value))


def test_two_supply_pressures_are_too_few():
    assert found(orifice, supplies=(35.0, 70.0))[1]["limiting_power, +100 %"].value is None
