"""Devices that answer lines of text, by their description, with a plant behind them; the twin of the driver."""

from __future__ import annotations

from sim_devices._described_text import DescribedText
from sim_devices._lines_of_text import serve_lines
from sim_devices._twin import described_in, offered

Settings, faults, terminals, open_daq, serve, quirks, world = offered(
    "text",
    serve_lines,
    lambda settings, side: DescribedText(side, described_in(settings, "text"), settings),
    "socket://127.0.0.1:0",
)
