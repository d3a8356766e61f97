"""`hil check-driver`: what every driver keeps, tried on its simulated twin or on real hardware."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from pathlib import Path

    from hil.bench.read import BenchFile
    from hil.daq.conformance import Subject


def command(
    driver: str = typer.Argument(..., metavar="NAME", help="Name of an installed driver."),
    bench: str = typer.Option(
        "", "--bench", metavar="BENCH.toml", help="Where the driver is used; default: an installed bench that uses it."
    ),
    hardware: bool = typer.Option(
        False, "--hardware", help="Drive the real device of that bench: its outputs WILL MOVE through half their range."
    ),
) -> None:
    """Check a driver against everything that the program expects of one. Exit status 1 if a check is not passed.

    Without `--hardware` the devices of the bench are simulated here, and their answers spoiled on purpose.
    HIL_BENCH=BENCH.toml stands for `--bench BENCH.toml --hardware`.
    """
    from hil.bench.find import find_bench
    from hil.bench.read import read_bench
    from hil.catalog import find
    from hil.daq.conformance import examine

    name = find("drivers", driver).name
    real = os.environ.get("HIL_BENCH", "")
    path = find_bench(bench or real) if bench or real else _bench_with(name)
    hardware = hardware or bool(real and not bench)
    counts = {"passed": 0, "broken": 0, "left out": 0}
    with subject(read_bench(path), path.parent, name, hardware) as examined:
        typer.echo(f"{name} on {path.name}, {'REAL HARDWARE' if hardware else 'simulated'}")
        for result in examine(examined):
            counts[result.verdict] += 1
            said = f": {result.text}" if result.text else ""
            typer.echo(f"  {result.verdict:8}  {result.check.replace('_', ' ')}{said}")
    typer.echo(", ".join(f"{count} {verdict}" for verdict, count in counts.items()))
    raise typer.Exit(1 if counts["broken"] else 0)


@contextmanager
def subject(file: BenchFile, folder: Path, driver: str, hardware: bool = False) -> Iterator[Subject]:
    """The first device of a bench with this driver, ready to be examined; simulated ones are served meanwhile.

    Raises:
        SettingError: the bench has no device with this driver, or an output may not be moved by half its range.
    """
    from hil.bench.device import simulation_of
    from hil.catalog import find
    from hil.daq.conformance import Subject
    from hil.errors import SettingError

    using = [name for name, device in file.bench.devices.items() if device.driver.replace("-", "_") == driver]
    if not using:
        raise SettingError(f'{file.path}: no device with driver = "{driver}"; say --bench with one that has it')
    device = file.devices[using[0]]
    wiring = device.wiring(file.bench.channels)
    if hardware:
        yield Subject(device.module, device.settings, wiring)
        return
    twin = find("devices", driver).load()
    wirings = {name: other.wiring(file.bench.channels) for name, other in file.devices.items()}
    side = twin.world(simulation_of(list(file.devices), file.bench, folder), wirings).side(using[0])
    served = twin.serve(file.bench.devices[using[0]].settings, side, twin.quirks({}))

    def spoil(**quirks: Any) -> None:
        served.behaviour.quirks = twin.quirks(quirks)

    elsewhere = device.settings.model_copy(update={"address": _elsewhere(served.where)})
    try:
        yield Subject(device.module, device.settings, wiring, elsewhere, side, spoil)
    finally:
        served.close()


def _elsewhere(address: str) -> str:
    """An address of the same kind where nobody answers."""
    if address.startswith("virtual:"):
        return f"{address}-nobody"
    head, colon, port = address.rpartition(":")
    return f"{head.rpartition('127')[0]}127.0.0.1:1" if colon and port.isdecimal() else f"{address}-nobody"


def _bench_with(driver: str) -> Path:
    """An installed bench that uses a driver."""
    import tomllib

    from hil.bench.find import benches
    from hil.errors import SettingError

    found: list[tuple[int, Path]] = []
    for path in benches().values():
        content = tomllib.loads(path.read_text(encoding="utf-8"))
        using = [name for name, device in content.get("devices", {}).items() if device.get("driver") == driver]
        connected = [channel for channel in content.get("channels", {}).values() if channel.get("device") in using]
        if using:  # the more of its outputs and inputs are in use, the more can be checked
            outputs = {"safe" in channel for channel in connected}
            found.append((-len(outputs), path))
    if found:
        return min(found)[1]
    raise SettingError(f"no installed bench uses driver '{driver}': say --bench BENCH.toml")
