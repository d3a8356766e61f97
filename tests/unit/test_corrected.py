"""How uncertain the values of a corrected model are."""

import math

import pytest

from hil.diagnosis.answer.corrected import beyond_noise


def test_nothing_is_known_better_than_the_recorder_keeps_time():
    assert beyond_noise(0.0, 10.0) == pytest.approx(10.0 * 50e-6 / math.sqrt(3.0))
    assert beyond_noise(0.5, -10.0) == pytest.approx(0.5, rel=1e-6)


def test_a_law_that_is_not_quite_natures_widens_an_interval():
    assert beyond_noise(0.3, 8.0, by_law=0.05) == pytest.approx(0.5)


def test_what_noise_leaves_open_stays_open():
    assert beyond_noise(None, 8.0, by_law=0.05) is None
