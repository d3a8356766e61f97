"""`hil new driver`: the files of a driver for a device with a register table, which pass from the start."""

from __future__ import annotations

from pathlib import Path

import typer

_DRIVER = '''"""NAME: what the device is and does, in one line; `hil list drivers` prints it."""

from __future__ import annotations

from collections.abc import Iterator

from drivers.modbus import LineSettings, ModbusLink, Model, Register, line_faults
from hil.daq.channel import Terminal, Wiring
from hil.daq.polled import PolledDaq

# The register table of the manual. Addresses as they stand on the wire, counted from 0: a manual's 40001 is holding
# register 0, its 30001 input register 0. value = slope * count + offset; formats: u16, s16, f32 (two registers).
MODEL = Model(
    {
        "out": Register("out", "voltage", "V", -10.0, 10.0, "holding", 0x0000, "s16", slope=10.0 / 32000),
        "in": Register("in", "voltage", "V", -10.0, 10.0, "input", 0x0000, "s16", slope=10.0 / 32000),
    },
    word_order="big",
)


class Settings(LineSettings):
    """What `[devices.NAME]` of a bench file may say: how the device is reached."""


def faults(settings: Settings) -> Iterator[tuple[tuple[str, ...], str]]:
    """What is wrong with the settings beyond their types."""
    yield from line_faults(settings, MODEL)


def terminals(_settings: Settings) -> dict[str, Terminal]:
    """What can be connected to the device."""
    return MODEL.terminals


def open_link(settings: Settings, wiring: Wiring) -> ModbusLink:
    """The device, connected."""
    return ModbusLink(settings, wiring, MODEL)


def open_daq(settings: Settings, wiring: Wiring) -> PolledDaq:
    """The device alone as a DAQ."""
    return PolledDaq({"NAME": open_link(settings, wiring)}, {"NAME": wiring})
'''

_TWIN = '''"""The simulated NAME with a plant behind its registers; the twin of the driver."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sim_devices._field import Side
from sim_devices._modbus_table import Place, Table, serve_registers
from sim_devices._quirks import Quirks
from sim_devices._stream import StreamServer
from sim_devices._twin import Twin, TwinSettings, quirks, world

__all__ = ["Settings", "faults", "open_daq", "quirks", "serve", "terminals", "world"]

# Type the table again from the manual, do not copy it from the driver: then a slip in one of them is found.
OUTPUTS = {0x0000: Place("out", per_unit=3200.0, signed=True)}
INPUTS = {0x0000: Place("in", per_unit=3200.0, signed=True)}


def serve(settings: Mapping[str, Any], side: Side, behave: Quirks) -> StreamServer:
    """Serve the device where the driver will look for it."""
    watchdog_s = settings.get("watchdog_s")
    return serve_registers(Table(side, OUTPUTS, INPUTS, watchdog_s), settings, side, behave)


_twin = Twin("NAME", serve, example="127.0.0.1:1502", free="127.0.0.1:0")
Settings, faults, terminals, open_daq = TwinSettings, _twin.faults, _twin.terminals, _twin.open_daq
'''

_TEST = '''"""The driver NAME passes every check on its twin, and says what the manual says."""

from __future__ import annotations

import socket
from pathlib import Path

from drivers import NAME
from hil.bench.read import read_bench
from hil.bench.twin import subject
from hil.daq.conformance import examine

BENCH = """
name = "Bench of NAME"
sample_rate_hz = 50

[valve]
name = "Brevini HPV41 with MHPED"
plant = "brevini-hpv41"

[devices.device]
driver = "NAME"
address = "127.0.0.1:PORT"
timeout_s = 0.1
longest_reply_s = 0.2

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
    with subject(read_bench(path), tmp_path, "NAME") as examined:
        results = list(examine(examined))
    assert [f"{result.check}: {result.text}" for result in results if result.verdict == "broken"] == []


def test_counts_of_the_manual() -> None:
    """Replace these by numbers that the manual prints: they are what driver and twin cannot both get wrong."""
    register = NAME.MODEL.registers["out"]
    assert [register.count_of(volts) for volts in (10.0, 0.0, -10.0)] == [32000, 0, 0x10000 - 32000]
'''


def command(
    kind: str = typer.Argument(..., metavar="driver", help="What to begin: a driver."),
    name: str = typer.Argument(..., metavar="NAME", help="Its name: lower-case letters, digits and _."),
    folder: Path = typer.Option(Path(), "--in", help="Folder with the packages `drivers` and `sim_devices`."),
) -> None:
    """Begin a driver for a device with a register table: the driver, its simulated twin, its test. All pass as written.

    docs/how-to/add-a-driver.md goes on from there.
    """
    from hil.errors import FileError, SettingError

    if kind != "driver":
        raise SettingError(f"'{kind}' cannot be begun here; there is: driver")
    if not name.isidentifier() or name != name.lower() or name.startswith("_"):
        raise SettingError(f"'{name}' is no name of a driver: lower-case letters, digits and _, a letter first")
    tests = folder / "tests" / "unit" if (folder / "tests" / "unit").is_dir() else folder / "tests"
    files = {
        folder / "drivers" / f"{name}.py": _DRIVER,
        folder / "sim_devices" / f"{name}.py": _TWIN,
        tests / f"test_driver_{name}.py": _TEST,
    }
    for path in files:
        if path.exists():
            raise FileError(f"{path}: is there already; nothing was written")
        if not path.parent.is_dir():
            raise FileError(f"{path.parent}: no such folder; say --in with the folder that has it")
    for path, text in files.items():
        path.write_text(text.replace("NAME", name), encoding="utf-8")
        typer.echo(path)
    typer.echo(f"next: put the manual's register table into both, then pytest {tests / f'test_driver_{name}.py'}")
