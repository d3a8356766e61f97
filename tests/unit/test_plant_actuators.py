"""Actuators whose pressures are measured or whose oil is a spring: laws against what can be worked out by hand."""

import math

import numpy as np
import pytest

from hil.physics.compose import plant
from hil.physics.simulate import ActiveEffect, Drive, simulate

ACTUATOR = plant("electro-hydraulic-actuator")


def moved(speed_rpm, pressure_a, pressure_b, *effects):
    """Positions over motor speed and pressures."""
    inputs = np.vstack([speed_rpm, pressure_a, pressure_b])
    return simulate(ACTUATOR, ACTUATOR.typical, Drive(inputs, 0.0, 0.01), effects)[0]


def test_it_retracts_faster_than_it_extends():
    still = np.zeros(501)
    out = moved(np.full(501, 600.0), still, still)
    back = moved(np.full(501, -600.0), still, still)
    assert np.isclose(out[-1], 0.7 * 10.0 * 5.0)
    assert np.isclose(-back[-1] / out[-1], 1.4)


def test_leakage_creeps_under_load_and_compliance_gives_back():
    still = np.zeros(501)
    loaded = np.where(np.arange(501) < 100, 0.0, 20.0)
    leak = ActiveEffect("internal_leakage", "chamber", {"leak": 0.05, "power": 2.0})
    creep = moved(still, loaded, still, leak)
    assert np.allclose(creep[:100], 0.0)
    assert np.isclose(creep[-1] - creep[-101], -0.05 * 2.0**2)  # in a second
    swell = ActiveEffect("compliance", "chamber", {"swell": 0.1})
    given = moved(still, np.where(np.abs(np.arange(501) - 250) < 50, 20.0, 0.0), still, swell)
    assert np.isclose(given[250], -2.0)
    assert np.isclose(given[-1], 0.0, atol=1e-12)


def test_the_arm_rings_on_its_oil_and_turbulent_losses_brake_only_fast_motion():
    crane = plant("hydraulic-actuator")
    values = crane.typical | {"drag": 0.0}
    opening = np.where(np.arange(4000) < 10, 0.0, -0.5)[None, :]
    free = simulate(crane, values, Drive(opening, 0.0, 0.1))[0]
    turns = np.flatnonzero(np.diff(np.sign(free[20:])) != 0)
    period_s = 2.0 * 0.1 * float(np.median(np.diff(turns)))
    assert abs(period_s - 2.0 * math.pi / values["oil_frequency"]) < 0.02 * period_s
    loss = ActiveEffect("turbulent_loss", "line", {"loss": 3.0})
    braked = simulate(crane, values, Drive(opening, 0.0, 0.1), [loss])[0]
    assert np.isclose(braked[-1], 3.0 * 0.5**2, rtol=0.02)  # what steady motion costs


@pytest.mark.parametrize("lost", [(), (ActiveEffect("turbulent_loss", "line", {"loss": 3.0}),)])
def test_half_the_step_leaves_the_crane_a_quarter_of_the_error(lost):
    crane = plant("hydraulic-actuator")
    opening = 0.8 * np.sin(np.cumsum(np.full(200, 0.1)))[None, :]

    def pressure(factor):
        return simulate(crane, crane.typical, Drive(opening, 0.0, 1.0), lost, factor=factor)[0]

    exact = pressure(64.0)
    coarse, fine = (float(np.std(pressure(factor) - exact)) for factor in (0.5, 1.0))
    assert 3.5 < coarse / fine < 4.5
    assert fine < 1e-4 * float(np.std(exact))


def test_a_crane_that_is_recorded_in_motion_goes_on_moving():
    crane = plant("hydraulic-actuator")
    values = crane.typical | {"lowering_ratio": 1.5}
    for opening, speed in ((-0.4, 0.4), (0.4, -1.5 * 0.4), (0.0, 0.0)):
        steady = values["load"] + values["drag"] * speed
        pressure = simulate(crane, values, Drive(np.full((1, 300), opening), steady, 0.1))[0]
        assert np.allclose(pressure, steady, atol=1e-9)
    limit = ActiveEffect("saturation", "opening", {"limit": 0.3, "knee": 0.001, "slope": 0.0})
    limited = simulate(crane, values, Drive(np.full((1, 300), -0.4), 0.3 * values["drag"], 0.1), [limit])[0]
    assert np.allclose(limited, 0.3 * values["drag"], atol=1e-3)


def test_drag_that_differs_between_directions_makes_one_of_them_faster():
    axis = plant("linear-axis")
    values = axis.typical | {"mass": 10.0, "viscous": 200.0}
    uneven = ActiveEffect("uneven_drag", "drag", {"difference": 0.2})
    for force, drag in ((100.0, 160.0), (-100.0, 240.0)):
        place = simulate(axis, values, Drive(np.full((1, 2000), force), 0.0, 0.001), [uneven])[0]
        assert np.isclose((place[-1] - place[-2]) / 0.001, force / drag, rtol=0.002)


def test_the_controller_of_the_axis_works_at_its_own_clock():
    axis = plant("servo-axis")
    reference = 0.1 * (1.0 - np.cos(np.arange(1500) / 300.0))[None, :]
    drive = Drive(reference, math.nan, 0.001)
    coarse = simulate(axis, axis.typical, drive)[0]
    fine = simulate(axis, axis.typical, drive, factor=16.0)[0]
    assert np.abs(coarse - fine).max() < 1e-6 * np.ptp(fine)
