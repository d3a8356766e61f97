"""The plant sample-valve: at rest it stays, and after a step it reaches its gain."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil.physics.compose import plant
from hil.physics.simulate import Drive, simulate


def test_step_of_the_command() -> None:
    definition = plant("sample-valve")
    command = np.concatenate((np.zeros(50), np.full(450, 40.0)))[None, :]
    output = simulate(definition, definition.typical, Drive(command, math.nan, 1e-3))[0]
    assert np.ptp(output[:50]) == 0.0
    assert output[-1] - output[0] == pytest.approx(40.0 * definition.typical["gain"], rel=1e-3)
