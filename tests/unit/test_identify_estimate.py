"""What an estimate says of its uncertainty."""

from __future__ import annotations

import numpy as np
import pytest

from hil.identify.estimate import Estimate, Unknown, estimate
from hil.record.recording import Array


def two_that_act_as_their_sum(count: int = 4000, noise: float = 0.1) -> Estimate:
    rng = np.random.default_rng(1)
    design = rng.standard_normal(count)
    measured = 3.0 * design + noise * rng.standard_normal(count)

    def residuals(values: Array) -> Array:
        left: Array = ((values[0] + values[1]) * design - measured) / noise
        return left

    return estimate(residuals, [Unknown("a", "s", 1.0, -10.0, 10.0, 1.0), Unknown("b", "s", 1.0, -10.0, 10.0, 1.0)])


def test_what_acts_as_a_sum_cannot_be_told_apart_but_is_there() -> None:
    found = two_that_act_as_their_sum()
    assert found.values.sum() == pytest.approx(3.0, abs=0.01)
    assert np.all(np.isinf(found.std))
    assert found.std_holding(0, [1]) == pytest.approx(0.1 / np.sqrt(4000), rel=0.1)
