"""The coil behind a PWM stage: ripple and duty exactly, the current loop, and its faults."""

import math

import numpy as np
import pytest

from hil.errors import InputError
from hil.physics.published.tugsal import INDUCTANCE_LIMIT_H, RESISTANCE_OHM, STEP_CURRENTS_A
from hil.physics.pwm import CurrentLoop, PwmCoil, PwmDrive

COIL = PwmCoil(2.1, 0.09, 13.8, 12.0, 1000.0)
LOOP = CurrentLoop(250.0, COIL, rated_a=2.5)
PERIOD_S = 1e-3


def integrated(coil, duty, periods=400, steps=500):
    """Euler–Heun of the switched coil: the last period's current."""
    h = 1.0 / coil.carrier_hz / steps
    i, last = 0.0, []
    keep = math.exp(-h / coil.time_constant_s)
    for k in range(periods * steps):
        volts = coil.supply_v if (k % steps) < duty * steps else 0.0
        i = volts / coil.resistance_ohm + (i - volts / coil.resistance_ohm) * keep
        if k >= (periods - 1) * steps:
            last.append(i)
    return np.array(last)


@pytest.mark.parametrize(("duty", "carrier_hz"), [(0.2, 1000.0), (0.5, 200.0), (0.8, 60.0)])
def test_ripple_is_that_of_an_integration(duty, carrier_hz):
    coil = PwmCoil(2.1, 0.03, 12.0, 12.0, carrier_hz)
    last = integrated(coil, duty)
    assert coil.extremes(duty) == pytest.approx((last.min(), last.max()), rel=1e-2)
    assert last.mean() == pytest.approx(duty * 12.0 / 2.1, rel=1e-2)


@pytest.mark.parametrize(("volts", "duties"), [(12, (21, 35)), (24, (36, 60))])
def test_duties_of_the_step_currents(volts, duties):
    ohm, _ = RESISTANCE_OHM[volts]
    coil = PwmCoil(ohm, INDUCTANCE_LIMIT_H, volts, volts, 1000.0)
    found = [100 * coil.duty(current) for current in (STEP_CURRENTS_A[0], STEP_CURRENTS_A[-1])]
    assert found == pytest.approx(duties, abs=0.5)


def test_ripple_of_a_short_period_is_a_triangle():
    low, high = COIL.extremes(0.3)  # U·D·(1 − D)/(L·f) where the period is short against L/R
    assert high - low == pytest.approx(13.8 * 0.3 * 0.7 / (0.09 * 1000.0), rel=1e-3)


def test_mean_voltage_stays_below_133_percent_of_the_coil_s():
    on_24_volts = PwmCoil(2.1, 0.09, 28.0, 12.0, 1000.0)
    assert on_24_volts.highest_duty == pytest.approx(1.33 * 12 / 28)
    with pytest.raises(InputError, match=r"8 A through 2.1 Ω; 0 … 7.6 A are allowed"):
        on_24_volts.duty(8.0)
    made = PwmDrive(CurrentLoop(250.0, on_24_volts, 100.0), on_24_volts).drive(np.full(1000, 50.0), PERIOD_S)
    assert made.max() <= 1.33 * 12 / 2.1 + 1e-9


def test_loop_reaches_its_demand_though_the_copper_is_warm():
    for coil in (COIL, PwmCoil(2.78, 0.09, 13.8, 12.0, 1000.0)):
        drive = PwmDrive(LOOP, coil)
        made = drive.drive(np.full(600, 1.6), PERIOD_S)
        assert drive.fault == "" and math.isnan(drive.fault_s)
        assert made[-50:] == pytest.approx(1.6, abs=2e-3) and made.max() < 1.6 * 1.1


def test_loop_does_not_follow_beyond_the_rating():
    made = PwmDrive(LOOP, COIL).drive(np.full(600, 9.0), PERIOD_S)
    assert made[-1] == pytest.approx(2.5, abs=5e-3) and made.max() < 1.1 * 2.5


def test_open_circuit_is_told_within_a_few_periods():
    drive = PwmDrive(LOOP, PwmCoil(1e5, 0.09, 13.8, 12.0, 1000.0))
    made = drive.drive(np.full(300, 1.6), PERIOD_S)
    assert drive.fault == "open" and drive.fault_s < 0.05
    assert made[-100:].max() < 1e-9


def test_short_circuit_opens_the_switch_within_a_period():
    drive = PwmDrive(LOOP, PwmCoil(0.02, 1e-4, 13.8, 12.0, 1000.0))
    made = drive.drive(np.full(300, 1.6), PERIOD_S)
    assert drive.fault == "short" and drive.fault_s < 2e-3
    assert made.max() <= 1.5 * 2.5 + 1e-9 and made[-1] < made.max()


def test_a_coil_is_checked():
    with pytest.raises(InputError, match="inductance_h = 0"):
        PwmCoil(2.1, 0.0, 12.0, 12.0, 1000.0)
