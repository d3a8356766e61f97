"""Drawings of motions keep to the stroke; a formula writes no dead time that is none."""

import re

import numpy as np
import pytest

from hil.physics.formula import formula
from hil.physics.transfer_function import transfer_function
from hil.report.motions import velocity_steps_section


def test_a_fitted_line_does_not_stretch_the_axis_beyond_the_motion():
    time_s = np.linspace(0.0, 5.0, 501)
    line = -96.0 + 185.0 * time_s
    step = {"label": "-96 → 96 mm", "response_unit": "mm", "time_s": time_s, "measured": np.minimum(line, 96.0),
            "fitted": line, "from_s": 0.1, "to_s": 0.44, "speed_per_s": 185.0}  # fmt: skip
    (picture,) = velocity_steps_section([step]).figures
    levels = [float(text.replace("\u2212", "-")) for text in re.findall(r">([\u2212-]?\d+)</text>", picture.svg)]
    assert min(levels) < -50.0 and 50.0 < max(levels) < 120.0


@pytest.mark.parametrize(("dead_time_s", "written"), [(3.7e-19, False), (0.0, False), (0.0185, True), (2e-5, True)])
def test_a_dead_time_that_is_none_is_not_written(dead_time_s, written):
    text = formula(transfer_function((6361.0,), (1.0, 31.7, 6345.0), dead_time_s))
    assert ("e^(" in text) is written
    assert "e-" not in text.replace("2e-05", "")
