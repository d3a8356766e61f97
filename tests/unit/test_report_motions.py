"""Drawings of motions keep to the stroke; a formula writes no dead time that is none."""

import numpy as np
import pytest

from hil.physics.formula import formula
from hil.physics.transfer_function import transfer_function
from hil.report.motions import _span


def test_a_fitted_line_does_not_stretch_the_axis_beyond_the_motion():
    time_s = np.linspace(0.0, 5.0, 501)
    measured = np.minimum(-96.0 + 185.0 * time_s, 96.0)
    low, high = _span(time_s, measured, -96.0 + 185.0 * time_s, 0.1, 0.44)
    assert -120.0 < low < -96.0 and 96.0 < high < 120.0


def test_the_line_is_seen_where_it_was_fitted():
    time_s = np.linspace(0.0, 1.0, 101)
    low, high = _span(time_s, np.zeros(101), 10.0 * time_s, 0.4, 0.6)
    assert low < 0.0 and 6.0 < high < 7.0


@pytest.mark.parametrize(("dead_time_s", "written"), [(3.7e-19, False), (0.0, False), (0.0185, True), (2e-5, True)])
def test_a_dead_time_that_is_none_is_not_written(dead_time_s, written):
    text = formula(transfer_function((6361.0,), (1.0, 31.7, 6345.0), dead_time_s))
    assert ("e^(" in text) is written
    assert "e-" not in text.replace("2e-05", "")
