"""The effect sample_wear does what its equation says, and nothing at its null."""

from __future__ import annotations

import pytest

from hil.catalog import find


def test_what_its_equation_says() -> None:
    effect = find("effects", "sample_wear").load().EFFECT
    law = getattr(effect.transform, "py_func", effect.transform)
    assert law(10.0, 0.0) == 10.0
    assert law(10.0, 0.25) == pytest.approx(7.5)
