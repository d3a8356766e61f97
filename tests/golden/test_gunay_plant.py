"""The SP08-47C with its cylinder in an open loop: speeds and pressures by the orifice law, dead band, loop, ends."""

import math

import numpy as np
import pytest

from hil.physics.compose import plant
from hil.physics.published import gunay
from hil.physics.simulate import Drive, simulate

VALVE = plant("hydraforce-open-loop")
TRUTH = VALVE.typical
INTERVAL_S = 1e-3
RATIO = gunay.CYLINDER.area_ratio
SUPPLY_BAR = TRUTH["supply_pressure"]
# mm³/s through a full edge at 1 bar
EDGE = TRUTH["rated_flow"] * 1e6 / 60 / math.sqrt(35.0)
NO_FRICTION = {"viscous": 0.0, "coulomb": 0.0}


def driven(current, start=0.0, **changed):
    """Position, spool, pressures A and B, supply for a current of shape (n,)."""
    return simulate(VALVE, TRUTH | changed, Drive(np.atleast_2d(current), start, INTERVAL_S))


def held(current, start, seconds=0.8, **changed):
    return driven(np.full(round(seconds / INTERVAL_S), float(current)), start, **changed)


def speed(position, seconds=0.2):
    """Over the last of it."""
    samples = round(seconds / INTERVAL_S)
    return (position[-1] - position[-1 - samples]) / seconds


def test_the_plant_has_the_published_geometry_and_the_data_sheets_currents():
    assert (TRUTH["bore"], TRUTH["rod"], TRUTH["stroke"]) == (50.0, 30.0, 250.0)
    assert TRUTH["rated_flow"] == gunay.FULL_FLOW_LPM
    assert TRUTH["first_flow"] == gunay.FIRST_FLOW_A
    assert TRUTH["first_flow"] + TRUTH["flow_range"] == pytest.approx(gunay.FULL_FLOW_A)
    assert 100 * TRUTH["hysteresis"] / gunay.FULL_FLOW_A < gunay.HYSTERESIS_PERCENT


def test_speeds_and_pressures_at_constant_pressure():
    head = gunay.CYLINDER.head_area_mm2
    share = RATIO**3
    # no load: P1·A1 = P2·A2, and the flows through both edges are those of one piston
    extending = EDGE * math.sqrt(share * SUPPLY_BAR / (1 + share)) / head
    retracting = EDGE * RATIO * math.sqrt(SUPPLY_BAR / (1 + share)) / head
    out = held(1.3, -100.0, **NO_FRICTION)
    back = held(-1.3, 100.0, **NO_FRICTION)
    assert speed(out[0]) == pytest.approx(extending, rel=0.01)
    assert speed(back[0]) == pytest.approx(-retracting, rel=0.02)  # the root is a line below 1 bar, B falls over 21 bar
    assert out[2, -1] == pytest.approx(SUPPLY_BAR / (1 + share), rel=0.02)
    assert back[2, -1] == pytest.approx(RATIO**2 * SUPPLY_BAR / (1 + share), rel=0.02)
    assert out[3, -1] == pytest.approx(RATIO * out[2, -1], rel=0.01)
    # by the areas alone it would retract 1.56 times as fast; it extends 1.25 times as fast
    assert -speed(out[0]) / speed(back[0]) == pytest.approx(math.sqrt(RATIO), rel=0.02)


def test_each_of_the_four_edges_counts_in_its_own_direction():
    out, back = speed(held(0.9, -50.0)[0]), speed(held(-0.9, 50.0)[0])
    for edge, extends in (("edge_b_return", True), ("edge_a_return", False), ("edge_supply_b", False)):
        out_now, back_now = speed(held(0.9, -50.0, **{edge: 0.5})[0]), speed(held(-0.9, 50.0, **{edge: 0.5})[0])
        changed, same = ((out_now, out), (back_now, back)) if extends else ((back_now, back), (out_now, out))
        assert abs(changed[0]) < 0.98 * abs(changed[1])
        assert same[0] == pytest.approx(same[1], rel=1e-9)


def test_flow_begins_at_0_4_ampere_and_is_full_at_1_1():
    assert np.ptp(held(0.41, 0.0)[0]) < 1e-6  # the magnet's loop holds 0.022 A back
    assert speed(held(0.43, 0.0)[0]) > 0.2
    assert np.ptp(held(-0.41, 0.0)[0]) < 1e-6
    full = held(1.3, -100.0)
    assert full[1, -1] == pytest.approx(100.0, abs=0.01)
    half = held(0.75 + 0.022, -100.0)
    assert half[1, -1] == pytest.approx(50.0, abs=0.01)


def test_the_loop_of_the_magnet_is_as_wide_as_stated_at_any_speed():
    up = np.linspace(0.0, 1.1, 1500)
    current = np.concatenate((np.zeros(50), up, up[::-1]))
    spool = driven(current, -120.0, spool_frequency=600.0, dead_time=0.0, rated_flow=0.5)[1]
    rising, falling = spool[50:1550], spool[1550:]
    at_50 = [np.interp(50.0, rising, up), np.interp(50.0, falling[::-1], up)]
    lag = 2 * 2 * 0.7 / 600.0 * 1.1 / 1.5  # of the spool itself, on both branches
    assert at_50[0] - at_50[1] == pytest.approx(TRUTH["hysteresis"] + lag, abs=2e-3)


def test_it_stops_at_both_ends_and_comes_back():
    current = np.concatenate((np.full(3000, 1.1), np.full(1000, -1.1)))
    position, *_ = driven(current, 0.0)
    assert position.max() == pytest.approx(125.0, abs=1e-6)
    assert position[-1] < 80.0


def test_a_load_slows_what_it_opposes_and_leakage_lets_it_creep():
    assert speed(held(1.0, -50.0, load=5000.0)[0]) < 0.95 * speed(held(1.0, -50.0)[0])
    assert np.ptp(held(0.0, 0.0, load=5000.0)[0]) < 1e-6
    # trapped oil: B fills from A until the rod's share of the pressure bears the load
    sinking = held(0.0, 0.0, seconds=4.0, piston_leakage=2000.0, load=8000.0, coulomb=0.0)
    assert sinking[0, -1] < -0.05
    assert sinking[2, -1] - sinking[3, -1] < 0.5 * (sinking[2, 0] - sinking[3, 0])


def test_the_oil_is_a_spring_under_the_mass():
    """A blocked cylinder rings at √(k/m) when the load is let go."""
    volume = 1e3 * TRUTH["dead_volume"] + np.array(
        [1.0, gunay.CYLINDER.rod_area_mm2 / gunay.CYLINDER.head_area_mm2]
    ) * (gunay.CYLINDER.head_area_mm2 * 125.0)
    areas = np.array([gunay.CYLINDER.head_area_mm2, gunay.CYLINDER.rod_area_mm2])
    stiffness = 0.1 * TRUTH["bulk_modulus"] * float(np.sum(areas**2 / volume))  # N/mm
    omega = math.sqrt(1e3 * stiffness / 1000.0)
    pulse = np.concatenate((np.full(60, 1.1), np.zeros(1500)))
    position = driven(pulse, 0.0, mass=1000.0, spool_frequency=600.0, dead_time=0.0, **NO_FRICTION)[0]
    ringing = position[200:] - position[200:].mean()
    crossings = np.flatnonzero((ringing[:-1] < 0) & (ringing[1:] >= 0))
    period_s = float(np.mean(np.diff(crossings[:20]))) * INTERVAL_S
    assert 2 * math.pi / period_s == pytest.approx(omega, rel=0.03)


def test_its_own_steps_neither_delay_nor_hasten_the_piston():
    command = np.repeat([0.0, 0.55, -0.55, 0.7, 0.0], 300)[None]
    values = TRUTH | {"dead_time": 0.0023}
    coarse = simulate(VALVE, values, Drive(command, 0.0, INTERVAL_S))[0]
    fine = simulate(VALVE, values, Drive(command, 0.0, INTERVAL_S), factor=16.0)[0]
    assert np.abs(coarse - fine).max() < 0.01  # mm, at up to 185 mm/s; half a step late it was 0.04
