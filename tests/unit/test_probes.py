"""The strengths at which two changes together take most, against a solver of bounded least squares."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from hil.diagnosis.search.probes import gains


@given(seed=st.integers(0, 10_000), alike=st.floats(0.0, 0.95))
def test_two_changes_take_as_much_as_bounded_least_squares_says(seed, alike):
    rng = np.random.default_rng(seed)
    common = rng.standard_normal(60)
    changes = (alike * common + (1.0 - alike) * rng.standard_normal((4, 60))).astype(np.float32)
    residuals = (rng.uniform(-4.0, 4.0, 4) @ changes + rng.standard_normal(60)).astype(np.float32)
    least, most = np.array([0.0, -3.0, 0.0, 0.0]), np.array([3.0, 3.0, 1.0, 1.0])
    gain, first, second = gains(changes, residuals, least, most)
    for i, j in ((0, 1), (0, 2), (2, 3)):
        bounds = least[[i, j]], most[[i, j]]
        best = lsq_linear(changes[[i, j]].T.astype(float), -residuals.astype(float), bounds)
        assert gain[i, j] == pytest.approx(float(residuals @ residuals) - 2.0 * best.cost, rel=1e-3, abs=1e-2)
        left = residuals + first[i, j] * changes[i] + second[i, j] * changes[j]
        assert float(residuals @ residuals - left @ left) == pytest.approx(gain[i, j], rel=1e-3, abs=1e-2)
