"""`hil check-driver`: what every driver keeps, tried on its simulated twin or on real hardware."""

from __future__ import annotations

import os
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING

import typer

from hil.cli.options import Json, argument, option
from hil.cli.printed import printed
from hil.errors import SettingError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from hil.bench.read import BenchFile
    from hil.daq.conformance import Subject

_REACH_ON_HARDWARE = 0.2


def command(
    driver: str = argument(..., "NAME", "Name of an installed driver."),
    bench: str = option(
        "", "--bench", "BENCH.toml", "Where the driver is used; default: an installed bench that uses it."
    ),
    device: str = option("", "--device", "NAME", "Which device of the bench; default: the first."),
    hardware: bool = option(
        False, "--hardware", help="Drive the device of that bench itself: its outputs WILL MOVE, within limits."
    ),
    reach: float = option(
        0.0,
        "--reach",
        "SHARE",
        "How far outputs go from their safe values towards their limits; default 0.2 on hardware, else 1.",
        min=0.0,
        max=1.0,
    ),
    measured_by: list[str] = option(
        [], "--measured-by", "OUTPUT=INPUT", "An input that measures an output, such as one wired to it."
    ),
    as_json: Json = False,
) -> None:
    """Check a driver against everything that the program expects of one. Exit status 1 if a check is not passed.

    What was driven is asked of the device again, also over a link opened anew, and compared with what was told.
    Without `--hardware` the devices of the bench are simulated here, and their answers spoiled on purpose.
    HIL_BENCH=BENCH.toml stands for `--bench BENCH.toml --hardware`.
    """
    from hil.bench.find import find_bench
    from hil.bench.lease import leased
    from hil.bench.protection_coverage.packages import check_packages
    from hil.bench.read import read_bench
    from hil.bench.twin import subject
    from hil.catalog import find
    from hil.daq.conformance import examine

    name = find("drivers", driver).name
    real = os.environ.get("HIL_BENCH", "")
    path = find_bench(bench or real) if bench or real else _bench_with(name)
    hardware = hardware or bool(real and not bench)
    reach = reach or (_REACH_ON_HARDWARE if hardware else 1.0)
    file = read_bench(path)
    check_packages(file)
    counts = {"passed": 0, "broken": 0, "left out": 0}
    checks: list[dict[str, str]] = []
    left: list[str] = []
    with (
        leased(file) if hardware else nullcontext(),
        subject(file, path.parent, name, hardware, reach, _pairs(measured_by), device) as examined,
    ):
        typer.echo(f"{name} on {path.name}, {'REAL HARDWARE' if hardware else 'simulated'}", err=as_json)
        with _rescued(file, examined, as_json, left) if hardware else nullcontext(examined) as watched:
            for result in examine(watched):
                counts[result.verdict] += 1
                checks.append({"check": result.check, "verdict": result.verdict, "text": result.text})
                text = f": {result.text}" if result.text else ""
                typer.echo(f"  {result.verdict:8}  {result.check.replace('_', ' ')}{text}", err=as_json)
    document = {
        "driver": name,
        "bench": path,
        "hardware": hardware,
        "checks": checks,
        "counts": counts,
        "left": "".join(left),
    }
    words = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    printed({"schema": "hil.driver-check/1", **document}, words, as_json)
    raise typer.Exit(1 if counts["broken"] else 0)


@contextmanager
def _rescued(file: BenchFile, examined: Subject, as_json: bool, left: list[str]) -> Iterator[Subject]:
    """A device under examination with a watchdog process, as every run has one; its outputs are left safe.

    Args:
        file: the bench.
        examined: the device.
        as_json: what is said goes to stderr.
        left: takes what is said of the outputs at the end.
    """
    from hil.bench.heartbeat import watched
    from hil.daq.conformance import left_safe
    from hil.record.state import state_path
    from hil.safety.outputs import Outputs

    output_states, folder = Outputs(), state_path("check-driver", file.bench.name, "")
    folder.mkdir(parents=True, exist_ok=True)
    with watched(file, folder, output_states) as watch:
        output_states.opened(examined.wiring.outputs)
        try:
            yield replace(examined, alive=watch.beat)
        finally:
            if text := left_safe(examined):
                left.append(text)
                typer.echo(text, err=as_json)
            output_states.opened({})  # they are safe, and no longer ours


def _pairs(typed: list[str]) -> dict[str, str]:
    pairs = {output: input_ for output, _, input_ in (text.partition("=") for text in typed)}
    for output, input_ in pairs.items():
        if not output or not input_:
            raise SettingError(f"--measured-by {output}={input_}: OUTPUT=INPUT, both names of channels of the bench")
    return pairs


def _bench_with(driver: str) -> Path:
    """An installed bench that uses a driver."""
    from hil.bench.find import benches
    from hil.untrusted import parse_toml, read_text

    found: list[tuple[int, Path]] = []
    for path in benches().values():
        content = parse_toml(read_text(path), str(path))
        using = [name for name, device in content.get("devices", {}).items() if device.get("driver") == driver]
        connected = [channel for channel in content.get("channels", {}).values() if channel.get("device") in using]
        if using:  # the more of its outputs and inputs are in use, the more can be checked
            outputs = {"safe" in channel for channel in connected}
            found.append((-len(outputs), path))
    if found:
        return min(found)[1]
    raise SettingError(f"no installed bench uses driver '{driver}': say --bench BENCH.toml")
