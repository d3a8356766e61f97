"""The EFC with its coil: current loop within its volts, copper that warms, duty drive, type, leakage."""

import math

import numpy as np
import pytest

from hil.physics.compose import plant
from hil.physics.plants.efc_drive import _CURVE_A, _CURVE_SHARE, _CURVE_SLOPE, throttle
from hil.physics.published.tugsal import STEP_CURRENTS_A, STEP_PRESSURES_PSI
from hil.physics.simulate import Drive, simulate

DRIVE, DUTY = plant("efc-drive"), plant("efc-duty")
PRESSURE, CURRENT, VOLTAGE, TEMPERATURE, FLOW, SUPPLY = range(6)
PROMPT = {"averaging_lag": 0.0, "dead_time": 0.0}


def run(definition, command, interval_s=1e-3, **changed):
    values = definition.typical | changed
    return simulate(definition, values, Drive(np.atleast_2d(command), math.nan, interval_s, 1.0))


def step(level, samples=1500, at=100):
    command = np.zeros(samples)
    command[at:] = level
    return command


def test_static_curve_goes_through_the_thesis_s_points():
    for current, pressure in zip(STEP_CURRENTS_A, STEP_PRESSURES_PSI, strict=True):
        assert run(DRIVE, np.full(3, current))[PRESSURE, -1] == pytest.approx(pressure, abs=1.0)


@pytest.mark.parametrize("dead_time", [0.0021, 0.0023, 0.0024])
def test_a_fraction_of_a_step_in_its_dead_time_is_exact_at_the_end_of_the_voltage(dead_time):
    command = step(1.8, 200, at=50)
    coarse = run(DRIVE, command, dead_time=dead_time)[CURRENT]
    fine = simulate(
        DRIVE, DRIVE.typical | {"dead_time": dead_time}, Drive(command[None], math.nan, 1e-3, 1.0), factor=40.0
    )[CURRENT]
    assert coarse == pytest.approx(fine, abs=1e-3)  # the mean of two demands began to act up to half a step early: 0.03


def test_static_curve_is_the_monotone_cubic_of_its_points():
    from scipy.interpolate import PchipInterpolator

    assert PchipInterpolator(_CURVE_A, _CURVE_SHARE).derivative()(_CURVE_A) == pytest.approx(_CURVE_SLOPE, abs=1e-3)
    grid = np.linspace(0.5, 2.5, 400)
    shares = np.array([throttle(i, 0.0, 1.0, 0.0) for i in grid])
    assert np.all(np.diff(shares) >= -1e-12) and shares[0] == 0.0 and shares[-1] == 1.0
    assert np.array([throttle(i, 0.0, 1.0, 1.0) for i in grid]) == pytest.approx(1.0 - shares)


def test_current_follows_the_loop_where_the_volts_suffice():
    # 50 rad/s ask for L·50·1 A + R·1 A = 6.7 V of 13.8 V
    out = run(DRIVE, step(1.0), **PROMPT, loop_bandwidth=50.0)
    t = np.arange(1, 1401) * 1e-3
    assert out[CURRENT, 100:] == pytest.approx(1.0 - np.exp(-50.0 * t), abs=1e-9)


def test_a_fast_demand_waits_for_the_coil_and_a_high_one_for_the_supply():
    out = run(DRIVE, step(2.0), **PROMPT, loop_bandwidth=5000.0, warming=0.0)
    assert out[VOLTAGE].max() == pytest.approx(13.8)
    hot = 2.1 * (1 + 0.00393 / (1 + 0.00393 * 2.2) * (40.0 - 22.2))
    reached_s = np.argmax(out[CURRENT] > 1.99) * 1e-3 - 0.1
    assert reached_s == pytest.approx(-0.09 / hot * math.log(1 - 1.99 * hot / 13.8), abs=2e-3)
    assert run(DRIVE, step(3.0), supply_voltage=5.0, warming=0.0)[CURRENT, -1] == pytest.approx(5.0 / hot, rel=1e-3)


def test_falling_current_freewheels():
    command = np.concatenate((np.full(300, 2.0), np.zeros(500)))
    out = run(DRIVE, command, **PROMPT, loop_bandwidth=5000.0, warming=0.0)
    assert out[VOLTAGE, 305:].min() == pytest.approx(0.0, abs=1e-9)
    hot = out[VOLTAGE, 250] / 2.0
    assert out[CURRENT, 339] == pytest.approx(2.0 * math.exp(-0.04 * hot / 0.09), rel=0.02)


def test_voltage_and_current_keep_the_coil_s_equation_through_their_instruments():
    out = run(DRIVE, step(1.5, 3000), interval_s=1e-4, warming=0.0)
    resistance = out[VOLTAGE, -1] / out[CURRENT, -1]
    area = np.trapezoid(out[VOLTAGE] - resistance * out[CURRENT], dx=1e-4)
    assert area / out[CURRENT, -1] == pytest.approx(0.09, rel=0.01)


def test_copper_warms_and_takes_volts_but_no_current():
    slow = np.full(4000, 1.5)
    out = run(DRIVE, slow, interval_s=0.5, warming_time=100.0)
    assert out[CURRENT, -1] == pytest.approx(1.5) and out[TEMPERATURE, 0] > 40.0
    assert out[TEMPERATURE, -1] == pytest.approx(40.0 + 1.5 * 1.5 * out[VOLTAGE, -1], rel=1e-3)


def test_duty_drive_loses_current_as_the_copper_warms():
    command = np.concatenate((np.zeros(4), np.full(4000, 30.0)))
    out = run(DUTY, command, interval_s=0.5, warming_time=100.0)
    early, late = out[CURRENT, 6], out[CURRENT, -1]
    assert early == pytest.approx(0.3 * 13.8 / 2.246, rel=0.01)
    assert late < 0.97 * early
    assert out[VOLTAGE, -1] == pytest.approx(0.3 * 13.8, rel=1e-6)


@pytest.mark.parametrize(("ohm", "volts", "duties"), [(2.1, 12.0, (21, 35)), (7.2, 24.0, (36, 60))])
def test_duties_of_the_thesis_s_currents(ohm, volts, duties):
    cold = {"coil_temperature": 22.2, "warming": 0.0, "resistance": ohm, "supply_voltage": volts}
    for duty, current in zip(duties, (1.2, 2.0), strict=True):
        assert run(DUTY, np.full(3, float(duty)), **cold)[CURRENT, -1] == pytest.approx(current, rel=0.03)


def test_a_normally_open_valve_is_the_other_way_round():
    closed, opened = (run(DRIVE, np.array([[0.0], [0.0]])[0], normally_open=kind) for kind in (0.0, 1.0))
    assert closed[PRESSURE, 0] < 4.0 and opened[PRESSURE, 0] > 200.0
    assert run(DRIVE, np.full(2, 2.2), normally_open=1.0)[PRESSURE, 0] < 4.0


def test_leakage_is_the_flow_of_the_closed_valve_and_lifts_its_pressure():
    little, much = (run(DRIVE, np.zeros(2), leakage=leak) for leak in (80.0, 160.0))
    assert little[FLOW, 0] == pytest.approx(80.0 * (220.0 - little[PRESSURE, 0]) / 220.0)
    assert much[PRESSURE, 0] == pytest.approx(4.0 * little[PRESSURE, 0])


@pytest.mark.parametrize(("ohm", "henry"), [(0.01, 1e-4), (1e5, 0.09)])
def test_short_and_open_coils_stay_finite(ohm, henry):
    out = run(DRIVE, step(1.5), resistance=ohm, inductance=henry)
    assert np.isfinite(out).all()
    assert out[CURRENT, -1] == pytest.approx(min(1.5, 13.8 / ohm), rel=0.08)
