"""Lags of instruments and coils: exact for what they are driven by, at rest at the first value."""

from __future__ import annotations

import numpy as np
import pytest

from hil.physics.effect import at_rest
from hil.physics.effects import coil_lag, sensor_lag, turbine_lag

STEP_S = 0.001


def sensed(values: np.ndarray, lag_s: float, second: float) -> np.ndarray:
    coefficients = sensor_lag.coefficients({"lag": lag_s, "second": second}, STEP_S)
    state = np.zeros(3)
    at_rest(values[0], state)
    given = [coefficients[name] for name in ("xx", "xv", "x0", "x1", "vx", "vv", "v0", "v1")]
    return np.array([sensor_lag.transform(v, state, *given) for v in values])


def turned(values: np.ndarray, *shape: float) -> np.ndarray:
    state = np.full(2, values[0])
    return np.array([turbine_lag.transform(v, STEP_S, 70.0, state, *shape) for v in values])


def built(values: np.ndarray, saturating: float) -> np.ndarray:
    parameters = {"lag": 0.02, "second": 0.0, "direct": 0.0, "saturating": saturating}
    given = coil_lag.coefficients(parameters, STEP_S)
    names = ("xx", "xv", "vx", "vv", "direct", "saturating")
    state = np.zeros(2)
    at_rest(values[0], state)
    return np.array([coil_lag.transform(v, state, 100.0, *(given[name] for name in names)) for v in values])


@pytest.mark.parametrize("second", [0.0, 0.7, 1.0, 1.8])
def test_a_sensor_at_rest_stays_there_and_lags_a_ramp_by_its_time_constant(second):
    assert sensed(np.full(50, 80.0), 0.01, second) == pytest.approx(80.0)
    time_s = STEP_S * np.arange(400)
    behind = 30.0 * time_s - sensed(30.0 * time_s, 0.01, second)
    assert behind[-1] == pytest.approx(30.0 * 0.01, rel=1e-6)


def test_a_turbine_lags_most_at_small_flow_and_when_it_falls():
    rise = np.concatenate([[0.0], np.full(2000, 1.0)])
    quick, slow = turned(70.0 * rise, 0.02, 0.4, 1.0), turned(0.7 * rise, 0.02, 0.4, 1.0)
    assert np.argmax(quick > 0.63 * 70.0) < np.argmax(slow > 0.63 * 0.7)
    assert quick[-1] == pytest.approx(70.0)
    fall = np.concatenate([[10.0], np.full(200, 5.0)])
    assert turned(fall, 0.02, 1.0, 1.5)[20] > turned(fall, 0.02, 1.0, 1.0)[20]


def test_a_saturated_coil_follows_sooner():
    step = np.concatenate([[0.0], np.full(100, 90.0)])
    assert built(step, 0.5)[20] > built(step, 0.0)[20]
    assert built(0.05 * step, 0.5)[20] == pytest.approx(built(0.05 * step, 0.0)[20], rel=2e-3)
