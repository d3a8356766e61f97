"""The simulated sample_amp with a plant behind its registers; the twin of the driver."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sim_devices.kit import Place, Quirks, Side, StreamServer, Table, Timer, Twin, TwinSettings, quirks, serve_registers, world

__all__ = ["Settings", "faults", "open_daq", "quirks", "serve", "terminals", "world"]

# Type the table again from the manual, do not copy it from the driver: then a slip in one of them is found.
OUTPUTS = {0x0000: Place("out", per_unit=3200.0, signed=True)}
INPUTS = {0x0000: Place("in", per_unit=3200.0, signed=True)}
WATCHDOG = Timer(0x0100, per_second=10.0, safe={0x0000: 0x0101})


def serve(settings: Mapping[str, Any], side: Side, behave: Quirks) -> StreamServer:
    """Serve the device where the driver will look for it."""
    return serve_registers(Table(side, OUTPUTS, INPUTS, timer=WATCHDOG), settings, side, behave)


_twin = Twin("sample_amp", serve, example="127.0.0.1:1502", free="127.0.0.1:0")
Settings, faults, terminals, open_daq = TwinSettings, _twin.faults, _twin.terminals, _twin.open_daq
