"""By how much a model is late or early beside a recording, as `hil compare` prints it."""

import numpy as np
import pytest

from hil.identification.grey_box.compare import Comparison, compare
from tests.concealed import NOISE, bound, nominal, records


def compared(later_s: float, noise: float) -> Comparison:
    """What the model itself gives, later by so much, with noise on it."""
    made = records(seed=23)[0]
    (e,) = bound(nominal(), [made])
    later = np.interp(e.time_s - later_s, e.time_s, e.simulated(nominal())[0])
    made.channels["flow"].values[:] = later + noise * np.random.default_rng(1).standard_normal(len(later))
    return compare(nominal(), *bound(nominal(), [made]))


@pytest.mark.parametrize(("later_s", "word"), [(0.02, "early"), (0.3, "early"), (-0.01, "late")])
def test_a_delay_far_beyond_a_rise_is_told_as_it_is(later_s, word):
    found = compared(later_s, NOISE)
    assert found.lag_s == pytest.approx(-later_s, abs=5e-4)
    assert f"model {word} by {1e3 * abs(found.lag_s):.1f} ms" in found.as_text()


def test_a_model_in_time_is_neither_late_nor_early():
    assert "model neither late nor early" in compared(0.0, 0.0).as_text()
