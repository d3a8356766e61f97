"""Coupled drives recorded from the moment of switching on, by a counter of pulses that is late."""

import math

import numpy as np
import pytest

from hil.physics.compose import plant
from hil.physics.simulate import Drive, simulate
from hil.record.recording import Array

DRIVES = plant("coupled-drives")
INTERVAL_S = 0.02


def speed(first_output: float, volts: float = 1.0, **changed: float) -> Array:
    command = np.full((1, 200), volts)
    answer: Array = simulate(DRIVES, DRIVES.typical | changed, Drive(command, first_output, INTERVAL_S))[0]
    return answer


def test_what_stands_at_the_first_reading_starts_from_rest_under_a_full_command():
    started = speed(0.0)
    assert started[0] == pytest.approx(0.0, abs=1e-12)
    assert started[-1] == pytest.approx(DRIVES.typical["gain"], rel=0.05)


def test_the_first_reading_of_a_counter_has_the_direction_of_the_command():
    assert speed(4.0, -1.0)[0] == pytest.approx(-4.0)
    assert np.ptp(speed(4.0, -1.0)) < 1e-9  # as fast as the command asks for: nothing moves on


def test_without_a_reading_the_drives_turn_as_the_command_has_them():
    assert speed(math.nan) == pytest.approx(DRIVES.typical["gain"])


def test_a_longer_count_is_read_later_and_nothing_else():
    plain, late = speed(0.0, count_time=0.02), speed(0.0, count_time=0.06)
    assert late[2:] == pytest.approx(plain[:-2], abs=1e-9)
