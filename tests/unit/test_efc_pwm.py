"""The coil behind a PWM stage: ripple and duty exactly, the current loop, and its faults."""

import math

import numpy as np
import pytest

from hil.errors import InputError
from hil.physics.published.tugsal import INDUCTANCE_LIMIT_H, RESISTANCE_OHM, STEP_CURRENTS_A
from hil.physics.pwm import CurrentLoop, PwmCoil, dithered, run_loop

COIL = PwmCoil(2.1, 0.09, 13.8, 12.0, 1000.0)
LOOP = CurrentLoop(250.0, COIL, rated_a=2.5)


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


def test_ripple_of_a_slow_carrier_depends_on_duty():
    slow = PwmCoil(2.1, 0.09, 12.0, 12.0, 100.0)
    ripples = [slow.ripple(duty) for duty in (0.1, 0.5, 0.9)]
    assert ripples[1] > 2.0 * ripples[0] and ripples[1] > 2.0 * ripples[2]
    assert COIL.ripple(0.3) < 0.04
    # a triangle of U·D·(1 − D)/(L·f) where the period is short against L/R
    assert COIL.ripple(0.3) == pytest.approx(13.8 * 0.3 * 0.7 / (0.09 * 1000.0), rel=1e-3)


def test_mean_voltage_stays_below_133_percent_of_the_coil_s():
    on_24_volts = PwmCoil(2.1, 0.09, 28.0, 12.0, 1000.0)
    assert on_24_volts.highest_duty == pytest.approx(1.33 * 12 / 28)
    with pytest.raises(InputError, match=r"8 A through 2.1 Ω; 0 … 7.6 A are allowed"):
        on_24_volts.duty(8.0)
    made = run_loop(CurrentLoop(250.0, on_24_volts, 100.0), on_24_volts, np.full(1000, 50.0))
    assert made.duty.max() <= on_24_volts.highest_duty + 1e-12
    assert made.mean_a.max() <= 1.33 * 12 / 2.1 + 1e-9


def test_loop_reaches_its_demand_though_the_copper_is_warm():
    warm = PwmCoil(2.78, 0.09, 13.8, 12.0, 1000.0)
    for coil in (COIL, warm):
        made = run_loop(LOOP, coil, np.full(600, 1.6))
        assert made.fault == "" and math.isnan(made.fault_s)
        assert made.mean_a[-50:] == pytest.approx(1.6, abs=2e-3)
        assert made.duty[-1] * 13.8 / coil.resistance_ohm == pytest.approx(1.6, abs=0.01)
        assert made.high_a.max() < 1.6 * 1.1
        assert np.all(made.low_a <= made.mean_a) and np.all(made.mean_a <= made.high_a)


def test_loop_does_not_follow_beyond_the_rating():
    made = run_loop(LOOP, COIL, np.full(600, 9.0))
    assert made.mean_a[-1] == pytest.approx(2.5, abs=5e-3) and made.high_a.max() < 1.1 * 2.5


def test_open_circuit_is_told_within_a_few_periods():
    made = run_loop(LOOP, PwmCoil(1e5, 0.09, 13.8, 12.0, 1000.0), np.full(300, 1.6))
    assert made.fault == "open" and made.fault_s < 0.05
    assert not made.duty[-100:].any()


def test_short_circuit_opens_the_switch_within_a_period():
    made = run_loop(LOOP, PwmCoil(0.02, 1e-4, 13.8, 12.0, 1000.0), np.full(300, 1.6))
    assert made.fault == "short" and made.fault_s < 2e-3
    assert made.high_a.max() <= 1.5 * 2.5 + 1e-9
    assert not made.duty[5:].any() and made.mean_a[-1] < made.mean_a.max()


def test_dither_leaves_the_mean():
    still = run_loop(LOOP, COIL, np.full(2000, 1.6))
    shaken = run_loop(LOOP, COIL, dithered(np.full(2000, 1.6), 1000.0, 125.0, 0.1))
    assert shaken.mean_a[-800:].mean() == pytest.approx(still.mean_a[-800:].mean(), abs=1e-3)
    assert np.ptp(shaken.mean_a[-800:]) > 0.03


@pytest.mark.parametrize("dither_hz", [300.0, 130.0])
def test_dither_that_would_change_the_mean_is_refused(dither_hz):
    with pytest.raises(InputError, match="whole multiple"):
        dithered(np.zeros(10), 1000.0, dither_hz, 0.1)


def test_a_coil_is_checked():
    with pytest.raises(InputError, match="inductance_h = 0"):
        PwmCoil(2.1, 0.0, 12.0, 12.0, 1000.0)
