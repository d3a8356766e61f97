"""An edge of the dead band that may as well lie at neutral is a bound, not a value with an uncertainty around 0."""

import pytest

from hil.record.measurement import Measurement
from procedures._characteristic import _edge

POSITIVE, NEGATIVE = Measurement("dead_band_positive", "mm", "", high=30.0), Measurement("dead_band_negative", "mm", "")


@pytest.mark.parametrize(
    ("of", "value", "std", "sign", "told"),
    [(NEGATIVE, 0.0, 13.0, -1, (">", -26.0)), (POSITIVE, 4.0, 13.0, 1, ("<", 30.0)),
     (POSITIVE, -1.0, 1.0, 1, ("<", 1.0)),
     (POSITIVE, 12.0, 1.0, 1, ("=", 12.0)), (NEGATIVE, -12.0, 1.0, -1, ("=", -12.0))],
)  # fmt: skip
def test_an_edge_that_may_lie_at_neutral_is_a_bound(of, value, std, sign, told):
    found = _edge(of, value, std, 0.0, sign, 0.0)
    assert (found.relation, found.value) == (told[0], pytest.approx(told[1]))


def test_a_bound_within_the_limit_passes():
    assert _edge(POSITIVE, 1.0, 2.0, 0.0, 1, 0.0).verdict == "pass"
