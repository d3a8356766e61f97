"""The way to the safe values."""

from __future__ import annotations

import pytest

from hil.safety.ramp import way_to


def test_each_output_at_its_own_slew() -> None:
    way = way_to({"a": 0.0, "b": 1.0}, {"a": 4.0, "b": -1.0}, {"a": 10.0, "b": 10.0}, 10.0)
    assert way is not None
    assert way.outputs["a"] == pytest.approx([3.0, 2.0, 1.0, 0.0])
    assert way.outputs["b"] == pytest.approx([0.0, 1.0, 1.0, 1.0])


def test_output_without_a_slew_jumps() -> None:
    way = way_to({"a": 0.0, "b": 1.0}, {"a": 2.0, "b": 9.0}, {"a": 10.0}, 10.0)
    assert way is not None
    assert way.outputs["b"].tolist() == [1.0, 1.0]


def test_last_sample_is_the_target_itself() -> None:
    way = way_to({"a": 0.1}, {"a": 7.3}, {"a": 0.7}, 10.0)
    assert way is not None
    assert way.outputs["a"][-1] == 0.1


def test_no_way_when_everything_is_there() -> None:
    assert way_to({"a": 1.0}, {"a": 1.0}, {}, 10.0) is None
