"""Values and half intervals as text: two digits of the interval, the value to the same place."""

import math

import pytest

from hil.signals.interval import rounded, width


@pytest.mark.parametrize(
    ("value", "std", "shown", "half"),
    [
        (0.02157, 0.00372, "0.0216", "± 0.0073"),
        (8766.2, 426.4, "8770", "± 840"),
        (42289.0, 12864.0, "42000", "± 25000"),
        (99.6, 50.8, "100", "± 100"),
        (2.5e-12, 1e-13, "2.50e-12", "± 2.0e-13"),
        (1.0 + 2e-16, 1e-17, "1", "± 2.0e-17"),
        (3.0, 0.0, "3", "± 0"),
        (3.0, math.inf, "3", "not identifiable"),
        (3.0, None, "3", "held"),
    ],
)
def test_an_interval_has_two_digits_and_its_value_the_same_place(value, std, shown, half):
    assert (rounded(value, std), width(std)) == (shown, half)
