"""Our recursive filter against scipy's."""

import numpy as np
import pytest

from hil.signals.recursion import filtered


@pytest.mark.parametrize("turn", [0.0, 0.1j])
@pytest.mark.parametrize(("above", "below"), [(1, 3), (4, 2), (3, 9), (3, 1)])
def test_filtered_is_as_scipy_filters(above, below, turn):
    from scipy.signal import lfilter

    rng = np.random.default_rng(above)
    numerator, rows = rng.standard_normal(above), rng.standard_normal((2, 300)) + turn
    denominator = np.r_[1.0, (0.3 * rng.standard_normal(below - 1) + turn) / below]
    expected = lfilter(numerator, denominator, rows) if below > 1 else [np.convolve(numerator, r)[:300] for r in rows]
    made = filtered(numerator, denominator, rows)
    assert made.shape == rows.shape
    np.testing.assert_allclose(made, expected, rtol=1e-13, atol=1e-13)
