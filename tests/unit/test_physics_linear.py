"""Linear stages are exact: against scipy, which solves the same equations by matrix exponentials."""

import math

import numpy as np
import pytest

from hil.physics.compose import plant
from hil.physics.linear import braked_mass, delay_steps, delayed, first_order, held_first_order, second_order
from hil.physics.simulate import Drive, simulate
from hil.physics.transfer_function import from_parameters
from hil.signals.recursion import filtered

STEP_S = 0.01
TIME_S = np.arange(400) * STEP_S
RNG = np.random.default_rng(7)
INPUT = np.concatenate(([0.0], RNG.normal(size=len(TIME_S) - 1)))


@pytest.mark.parametrize("lag_s", [1e-4, 0.01, 0.3, 20.0])
@pytest.mark.parametrize("held", [False, True], ids=["straight inputs", "held inputs"])
def test_first_order(held, lag_s):
    from scipy.signal import lsim

    keep, old, new = first_order(lag_s, STEP_S)
    if held:
        keep = held_first_order(lag_s, STEP_S)
        old, new = 1.0 - keep, 0.0
    exact = lsim(([1.0], [lag_s, 1.0]), INPUT, TIME_S, interp=not held)[1]
    assert np.allclose(filtered([new, old], [1.0, -keep], INPUT), exact, atol=1e-10)


@pytest.mark.parametrize("drag", [0.0, 1e-9, 0.002, 30.0, 3000.0])
def test_a_braked_mass_under_a_held_force(drag):
    from scipy.signal import lsim

    mass = 2.0
    keep, mobility, travel, compliance = braked_mass(mass, drag, STEP_S)
    place = speed = 0.0
    found = np.zeros((len(TIME_S), 2))
    for k in range(1, len(TIME_S)):
        force = INPUT[k - 1]
        place, speed = place + travel * speed + compliance * force, keep * speed + mobility * force
        found[k] = place, speed
    a, b = np.array([[0.0, 1.0], [0.0, -drag / mass]]), np.array([[0.0], [1.0 / mass]])
    exact = lsim((a, b, np.eye(2), np.zeros((2, 1))), INPUT, TIME_S, interp=False)[1]
    assert np.allclose(found, exact, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("damping", [0.05, 0.7, 1.0 - 1e-14, 1.0, 1.0 + 1e-6, 3.0])
@pytest.mark.parametrize("frequency_rad_s", [1.0, 33.0, 300.0])
def test_second_order_between_straight_inputs(frequency_rad_s, damping):
    from scipy.signal import lsim

    xx, xv, x0, x1, vx, vv, v0, v1 = second_order(frequency_rad_s, damping, STEP_S)
    place = speed = 0.0
    found = np.zeros((len(TIME_S), 2))
    for k in range(1, len(TIME_S)):
        u0, u1 = INPUT[k - 1], INPUT[k]
        place, speed = xx * place + xv * speed + x0 * u0 + x1 * u1, vx * place + vv * speed + v0 * u0 + v1 * u1
        found[k] = place, speed
    w2 = frequency_rad_s**2
    a = np.array([[0.0, 1.0], [-w2, -2.0 * damping * frequency_rad_s]])
    exact = lsim((a, np.array([[0.0], [w2]]), np.eye(2), np.zeros((2, 1))), INPUT, TIME_S, interp=True)[1]
    assert np.allclose(found[:, 0], exact[:, 0], atol=1e-8)
    assert np.allclose(found[:, 1], exact[:, 1], atol=1e-8 * frequency_rad_s)


def test_a_step_of_infinity_is_the_steady_state():
    assert first_order(0.3, math.inf) == (0.0, 0.0, 1.0)
    assert held_first_order(0.3, math.inf) == 0.0
    assert braked_mass(2.0, 30.0, math.inf) == (0.0, 0.0, 0.0, 0.0)
    xx, xv, x0, x1, *speeds = second_order(33.0, 0.5, math.inf)
    assert (xx, xv, x0 + x1) == (0.0, 0.0, 1.0)
    assert speeds == [0.0] * 4
    assert delay_steps(0.1, math.inf) < 0.0


@pytest.mark.parametrize("steps", [0.0, 1.0, 2.25, 7.5, 40.0])
def test_the_delay_line_keeps_the_mean_over_a_split_step(steps):
    line = np.zeros(50)
    delayed.py_func(line, 0.0, -1.0)
    found = np.array([delayed.py_func(line, float(value), steps) for value in INPUT])
    k = np.arange(len(INPUT), dtype=float)
    assert np.allclose(found, np.interp(k - steps, k, INPUT, left=0.0), atol=1e-12)


PARAMETERS = [
    {"gain": 2.0, "lag_time": 0.3},
    {"gain": 2.0, "lag_time": 0.3, "bend": -0.15, "dead_time": 0.05},
    {"gain": 2.0, "lag_time": 0.3, "bend": -0.15, "is_odd": 1.0},
    {"gain": -3.0, "offset": 4.0, "pair1_time": 0.05, "pair1_damping": 0.2, "dead_time": 0.07},
    {"gain": 1.5, "lag_time": 0.02, "pair1_time": 0.1, "pair1_damping": 0.4, "pair1_zero": -0.03,
     "pair2_time": 0.4, "pair2_damping": 1.7, "pair2_zero": 0.2, "pair2_zero_square": 0.01},
]  # fmt: skip


@pytest.mark.parametrize("given", PARAMETERS)
def test_the_linear_plant_is_exact_at_any_interval(given):
    from scipy.signal import lsim

    definition = plant("transfer-function")
    values = definition.typical | given
    model = from_parameters(values)
    simulated = simulate(definition, values, Drive(INPUT[None, :].copy(), math.nan, STEP_S))[0]
    late = round(values["dead_time"] / STEP_S)
    bent = INPUT * (np.abs(INPUT) if values["is_odd"] else INPUT)
    held = np.concatenate((np.zeros(late), (INPUT + values["bend"] * bent)[: len(INPUT) - late]))
    exact = lsim((model.numerator, model.denominator), held, TIME_S, interp=False)[1]
    assert np.allclose(simulated, exact + values["offset"], atol=1e-9)
