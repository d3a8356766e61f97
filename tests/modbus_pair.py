"""A device on Modbus with one input and one output that can be read back, and its wiring."""

from __future__ import annotations

from drivers.modbus import Model, Register
from hil.daq.channel import Wiring
from tests.channels import inputs, outputs

MODEL = Model({
    "t": Register("in", "value", "degC", -50.0, 500.0, "input", 0),
    "q": Register("out", "value", "bar", 0.0, 500.0, "holding", 8),
})  # fmt: skip
WIRING = Wiring(outputs(["q"], "bar", 0.0, 500.0), inputs(["t"], "degC", -50.0, 500.0))
