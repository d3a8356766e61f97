"""The way to the safe values."""

import pytest

from hil.safety.ramp import way_to


@pytest.mark.parametrize(
    ("safe", "at", "slew_per_s", "way"),
    [
        ({"a": 0.0, "b": 1.0}, {"a": 4.0, "b": -1.0}, {"a": 10.0, "b": 10.0},
         {"a": [3.0, 2.0, 1.0, 0.0], "b": [0.0, 1.0, 1.0, 1.0]}),
        ({"a": 0.0, "b": 1.0}, {"a": 2.0, "b": 9.0}, {"a": 10.0}, {"a": [1.0, 0.0], "b": [1.0, 1.0]}),  # b jumps
    ],
)  # fmt: skip
def test_each_output_at_its_own_slew(safe, at, slew_per_s, way):
    found = way_to(safe, at, slew_per_s, 10.0)
    assert {name: values.tolist() for name, values in found.outputs.items()} == way


def test_last_sample_is_the_target_itself():
    way = way_to({"a": 0.1}, {"a": 7.3}, {"a": 0.7}, 10.0)
    assert way.outputs["a"][-1] == 0.1


def test_no_way_when_everything_is_there():
    assert way_to({"a": 1.0}, {"a": 1.0}, {}, 10.0) is None
