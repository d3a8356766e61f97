"""The driver sample_lab passes every check on its twin, and says what the manual says."""

from __future__ import annotations

import socket
from pathlib import Path

from sample_lab.drivers import sample_lab
from hil.bench.read import read_bench
from hil.bench.twin import subject
from hil.daq.conformance import examine

BENCH = """
name = "Bench of sample_lab"
sample_rate_hz = 50

[valve]
name = "Brevini HPV41 with MHPED"
plant = "brevini-hpv41"

[devices.device]
driver = "sample_lab"
address = "127.0.0.1:PORT"
timeout_s = 0.1
longest_reply_s = 0.2
watchdog_s = 0.3

[channels.command]
role = "command"
device = "device"
terminal = "out"
unit = "%"
calibration = { slope = 10.0 }
safe = 0.0

[channels."spool position"]
role = "response"
device = "device"
terminal = "in"
unit = "%"
calibration = { slope = 12.5 }
"""


def test_driver_passes_every_check(tmp_path: Path) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    path = tmp_path / "bench.toml"
    path.write_text(BENCH.replace("PORT", str(port)), encoding="utf-8")
    with subject(read_bench(path), tmp_path, "sample_lab") as examined:
        results = list(examine(examined))
    assert [f"{result.check}: {result.text}" for result in results if result.verdict == "broken"] == []


def test_counts_of_the_manual() -> None:
    """Replace these by numbers that the manual prints: they are what driver and twin cannot both get wrong."""
    register = sample_lab.MODEL.registers["out"]
    assert [register.count_of(volts) for volts in (10.0, 0.0, -10.0)] == [32000, 0, 0x10000 - 32000]
