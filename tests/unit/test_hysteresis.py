"""The loop of magnetic hysteresis: as wide as its width in the middle, closed by saturation."""

from __future__ import annotations

import numpy as np
import pytest

from hil.physics.effect import at_rest
from hil.physics.effects import fading_hysteresis
from hil.physics.effects.hysteresis import PLAYS, transform

WIDTH, REACH = 2.0, 10.0


def lag(command: np.ndarray, closing: float, least: float = 0.1) -> np.ndarray:
    """How far the output lags, at every command in %."""
    state = np.full(PLAYS, command[0])
    return np.array([v - transform(v, state, 100.0, WIDTH, REACH, least, closing) for v in command])


@pytest.mark.parametrize("least", [0.0, 0.5, 0.9])
def test_its_half_width_is_reached_once_the_travel_is(least):
    command = np.linspace(-50.0, 50.0, 201)
    assert lag(command, 0.0, least)[np.abs(command) < 20.0] == pytest.approx(WIDTH)


def test_it_narrows_towards_saturation():
    up = np.linspace(-100.0, 100.0, 401)
    of = lag(up, 1.0)
    assert of[np.argmin(np.abs(up))] == pytest.approx(WIDTH)
    assert of[-1] == pytest.approx(0.5 * WIDTH)


def test_it_does_not_depend_on_speed():
    command = 80.0 * np.sin(np.linspace(0.0, 9.0, 300))
    slower = np.repeat(command, 3)
    assert lag(slower, 1.0)[2::3] == pytest.approx(lag(command, 1.0))


def test_a_memory_that_fades_is_worn_off_by_small_motions():
    state = np.zeros(2)
    at_rest(0.0, state)

    def behind(command):
        return [v - fading_hysteresis.transform(v, state, 100.0, WIDTH, REACH, 0.0) for v in command][-1]

    assert behind(np.linspace(0.0, 50.0, 101)) == pytest.approx(WIDTH, rel=0.01)
    assert abs(behind(50.0 + 0.5 * np.sin(np.arange(400)))) < 0.1 * WIDTH
