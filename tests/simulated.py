"""Simulated devices for tests, built without a bench file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hil.clock import Clock
from hil.daq.channel import InputChannel, OutputChannel, Pwm, Wiring
from sim_devices.in_process import Settings, SimulatedDaq, open_daq

COMMAND = {"direction": "out", "signal": "command", "unit": "%", "slope": 10.0}
FLOW = {"signal": "flow", "unit": "l/min", "slope": 10.0}
SPOOL = {"signal": "spool position", "unit": "%", "slope": 12.5}
READ_BACK = {"signal": "command", "unit": "%", "slope": 10.0}


def hpv41(
    inputs: Mapping[str, Mapping[str, Any]] | None = None,
    *,
    clock: Clock | None = None,
    safe_v: float = 0.0,
    simulation: Mapping[str, Any] | None = None,
    **settings: Any,
) -> SimulatedDaq:
    """The HPV41 behind a DAQ: output `command` (10 %/V), and inputs by name with their instruments."""
    inputs = {"flow": FLOW} if inputs is None else inputs
    world = {"plant": "brevini-hpv41", "instruments": {"command": COMMAND, **inputs}, **(simulation or {})}
    wiring = Wiring(
        {"command": OutputChannel("command", "ao0", "voltage", "V", -10.0, 10.0, safe_v)},
        {name: InputChannel(name, f"ai{i}", "voltage", "V", -10.0, 10.0) for i, name in enumerate(inputs)},
    )
    return open_daq(Settings.model_validate({"simulation": world, **settings}), wiring, clock)


def efc(pwm: Pwm, **settings: Any) -> SimulatedDaq:
    """The EFC behind a PWM current drive, with a shunt in the coil's circuit (0.5 A/V)."""
    instruments = {
        "current": {"direction": "out", "signal": "current", "unit": "A"},
        "coil current": {"signal": "current", "unit": "A", "slope": 0.5},
    }
    wiring = Wiring(
        {"current": OutputChannel("current", "pwm0", "pwm_current", "A", 0.0, 3.0, 0.0, pwm)},
        {"coil current": InputChannel("coil current", "ai0", "voltage", "V", -10.0, 10.0)},
    )
    world = {"plant": "cummins-efc", "instruments": instruments}
    return open_daq(Settings.model_validate({"simulation": world, **settings}), wiring)
