"""A backend behind calibrations."""

import numpy as np
import pytest
from wire import Wire

from hil.daq.calibration import Calibration
from hil.daq.contract import Waveform
from hil.daq.scaled import Scaled
from tests.driven import played

CALIBRATIONS = {
    "a": Calibration("%", slope=10.0),
    "b": Calibration("bar", slope=-5.0, offset=10.0),
    "a read": Calibration("l/min", slope=2.0, offset=1.0),
    "b read": Calibration("V"),
}


def test_what_is_driven_and_read_goes_through_the_calibrations():
    wire = Wire()
    block = played(Scaled(wire, CALIBRATIONS), Waveform(100.0, {"a": np.array([50.0, 100.0])}))
    assert [value for value, _ in wire.log["a"]] == [5.0, 10.0]
    assert block.inputs["a read"].tolist() == [11.0, 21.0]
    assert block.outputs["a"].tolist() == [50.0, 100.0]


def test_ranges_safe_values_and_levels_are_in_engineering_units():
    scaled = Scaled(Wire(levels={"b": 2.0}, safe={"b": 1.0}), CALIBRATIONS)
    channel = scaled.outputs["b"]
    assert (channel.unit, channel.low, channel.high, channel.safe) == ("bar", -40.0, 60.0, 5.0)
    assert scaled.levels["b"] == 0.0
    assert (scaled.inputs["a read"].low, scaled.inputs["a read"].high) == (-39.0, 41.0)


def test_leaving_a_stream_early_ends_the_task():
    asked = []

    def endless():
        while True:
            asked.append(1)
            yield Waveform(100.0, {"a": np.zeros(5)})

    blocks = Scaled(Wire(), CALIBRATIONS).stream(endless())
    next(blocks)
    blocks.close()
    count = len(asked)
    with pytest.raises(StopIteration):
        next(blocks)
    assert len(asked) == count
