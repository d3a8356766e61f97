"""`hil check-driver`: what every driver keeps, tried on its simulated twin or on real hardware."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from pathlib import Path


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
    from hil.bench.twin import subject
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
