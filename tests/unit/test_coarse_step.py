"""The step of a coarse channel is read off all its levels, however the finer one beneath rounds them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hil.diagnose.events.coarse import lattice

FINE = 0.01


@example(seed=0, step=1.3800639474034435, missing=0.0)
@given(seed=st.integers(0, 10_000), step=st.floats(0.3, 5.0), missing=st.floats(0.0, 0.7))
def test_the_step_is_known_better_than_the_converter_rounds(seed: int, step: float, missing: float) -> None:
    rng = np.random.default_rng(seed)
    number = np.flatnonzero(rng.uniform(size=120) >= missing)
    levels = np.unique(FINE * np.rint((step * (number - 40) + 0.3) / FINE))
    found, std = lattice(levels, float(np.diff(levels).min()), FINE)
    assert std < 0.1 * FINE
    assert abs(found - step) < 5.0 * std


def test_two_levels_give_no_line() -> None:
    found, std = lattice(np.array([1.0, 2.5]), 1.5, FINE)
    assert found == 1.5
    assert std == pytest.approx(FINE / 6.0**0.5)
