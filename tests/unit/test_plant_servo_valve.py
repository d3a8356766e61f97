"""Servo valves on slow sweeps: what each effect does to the curve."""

import math

import numpy as np

from hil.physics.compose import plant
from hil.physics.simulate import ActiveEffect, Drive, simulate

SWEEP_MA = np.interp(np.arange(5001), [0, 1000, 3000, 5000], [0.0, 25.0, -25.0, 25.0])


def curve(name, *effects):
    """The output over the sweep."""
    valve = plant(name)
    return simulate(valve, valve.typical, Drive(SWEEP_MA[None, :], math.nan, 1.0, read_at=1.0), effects)[0]


def test_pressure_follows_current_up_to_the_supply():
    found = curve("servo-valve-blocked")
    assert np.allclose(found, np.clip(200.0 * SWEEP_MA, -207.0, 207.0))


def test_hysteresis_parts_the_branches_by_its_width_and_leaking_lands_round_the_corners():
    loop = ActiveEffect("hysteresis", "coil", {"width": 0.4, "reach": 2.0, "least": 0.0, "closing": 0.0})
    found = curve("servo-valve-blocked", loop)
    rising = np.flatnonzero(np.diff(SWEEP_MA) > 0.0)
    down = 1000 + int(np.argmin(np.abs(found[1000:3000])))
    up = 3000 + int(np.argmin(np.abs(found[3000:])))
    assert up in rising
    assert abs((SWEEP_MA[up] - SWEEP_MA[down]) - 0.8) < 0.06
    round_one = curve("servo-valve-blocked", ActiveEffect("land_leakage", "blocked", {"softness": 0.5}))
    x = 200.0 * SWEEP_MA / 207.0
    assert np.allclose(round_one, 207.0 * x / np.sqrt(1.0 + x**2))


def test_flow_droops_with_the_root_of_the_supply():
    droop = ActiveEffect(
        "supply_droop", "supply", {"droop": 0.19, "recovery": 0.01, "power": 2.0, "line": 0.0, "lean": 0.0}
    )
    found = curve("servo-valve", droop)
    assert np.isclose(found[1000], 0.4 * 25.0 * 0.9)
    assert np.isclose(found[3000], -0.4 * 25.0 * 0.9)
