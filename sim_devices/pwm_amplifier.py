"""PWM current amplifiers on Modbus, with a coil and its valve behind them; the twin of the driver (map of our own)."""

from __future__ import annotations

from sim_devices._modbus_described import DescribedBank
from sim_devices._modbus_table import serve_registers
from sim_devices._twin import described_in, offered

Settings, faults, terminals, open_daq, serve, quirks, world = offered(
    "pwm_amplifier",
    serve_registers,
    lambda _, side: DescribedBank(side, described_in({"model": "pwm-amplifier"}, "modbus"), {}),
    "127.0.0.1:0",
)
