"""Devices that answer lines of text, by their description, with a plant behind them; the twin of the driver."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sim_devices._described_text import DescribedText
from sim_devices._field import Side
from sim_devices._lines_of_text import serve_text
from sim_devices._quirks import Quirks
from sim_devices._stream import StreamServer
from sim_devices._twin import Twin, TwinSettings, described_in, quirks, world

__all__ = ["Settings", "faults", "open_daq", "quirks", "serve", "terminals", "world"]


def serve(settings: Mapping[str, Any], side: Side, behave: Quirks) -> StreamServer:
    """Serve the device where the driver will look for it."""
    described = described_in(settings, "text")
    return serve_text(lambda terminals: DescribedText(terminals, described, settings), settings, side, behave)


_twin = Twin("text", serve, example="socket://127.0.0.1:4001", free="socket://127.0.0.1:0")
Settings, faults, terminals, open_daq = TwinSettings, _twin.faults, _twin.terminals, _twin.open_daq
