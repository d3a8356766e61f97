"""`hil watch`: what every input of a bench reads, without an output being opened."""

from __future__ import annotations

import math
import sys
import time
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import typer

from hil.cli.options import Bench, Json, option
from hil.printable import printable, raw
from hil.units import behind_a_number

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from hil.bench.manual.reading import Reading

_HEADINGS = ("channel", "raw", "value", "noise", "age [s]", "state")


def command(
    bench: Bench,
    channels: list[str] = option([], "--channel", "NAME", "Only this input; again for more."),
    seconds: float = option(math.inf, "--seconds", "S", "End after so long; default: at Ctrl-C."),
    every: float = option(0.5, "--every", "S", "How often the readings are shown."),
    csv: Path | None = option(None, "--csv", "FILE", "Write every row that is shown here too."),
    as_json: Json = False,
    lines: bool = option(False, "--lines", help="Say it each time, as one line of the same JSON."),
) -> None:
    """Every input of a bench: raw value, value, noise, age, and in words whether it can be believed.

    No output is opened, and nothing is written to a device that could move one. A device that does not answer is asked
    again each second; when one does not at the end, the exit status is 3.
    """
    from hil import api
    from hil.api.bench import bench_of
    from hil.cli.places import check_file
    from hil.errors import LinkError

    file = bench_of(bench)
    if csv is not None:
        check_file(csv)
    readings: Sequence[Reading] = []
    with ExitStack() as stack:
        show = _shower(file.bench.name, as_json, lines, stack)
        keep = _kept(stack.enter_context(csv.open("w", encoding="utf-8"))) if csv else (lambda _at_s, _readings: None)
        polls = stack.enter_context(closing(api.watch(file, channels, every_s=every, seconds=seconds)))
        begun_s, step = time.monotonic(), 0
        try:
            for step, readings in enumerate(polls, 1):
                show(step * every, readings)
                keep(step * every, readings)
                if not file.is_simulated or lines or sys.stdout.isatty():  # virtual time waits for who looks on
                    time.sleep(max(0.0, begun_s + every - time.monotonic()))
                begun_s = time.monotonic()
        except LinkError:
            if not step:  # it could not begin
                raise
            _say_last(file.bench.name, readings, as_json)
            raise
        _say_last(file.bench.name, readings, as_json)


def _say_last(bench: str, readings: Sequence[Reading], as_json: bool) -> None:
    if as_json:
        typer.echo(_as_json(bench, readings))


def _shower(bench: str, as_json: bool, lines: bool, stack: ExitStack) -> Callable[[float, Sequence[Reading]], None]:
    """What shows the readings of each look."""
    if lines:
        return lambda _at_s, readings: print(_as_json(bench, readings), flush=True)
    return (lambda _at_s, _readings: None) if as_json else stack.enter_context(_display())


@contextmanager
def _display() -> Iterator[Callable[[float, Sequence[Reading]], None]]:
    """A function that shows readings: a table that lives on a terminal, lines elsewhere."""
    if not sys.stdout.isatty():
        yield _plain
        return
    from rich.console import Console
    from rich.live import Live

    with Live(console=Console(file=raw(sys.stdout)), auto_refresh=False) as live:
        yield lambda _at_s, readings: live.update(_table(readings), refresh=True)


def _plain(at_s: float, readings: Sequence[Reading]) -> None:
    width = max(len(reading.name) for reading in readings)
    for reading in readings:
        name, raw, value, noise, age, state = _row(reading)
        typer.echo(f"{at_s:8.1f} s  {name:{width}}  {raw:>14}  {value:>16}  noise {noise}  age {age} s  {state}")


def _table(readings: Sequence[Reading]) -> Any:
    from rich.table import Table
    from rich.text import Text

    table = Table(*_HEADINGS)
    for reading in readings:
        *cells, state = _row(reading)
        style = "" if state == "ok" else "bold red"
        table.add_row(*(Text(printable(cell)) for cell in cells), Text(printable(state), style=style))
    return table


def _row(reading: Reading) -> tuple[str, str, str, str, str, str]:
    noise = "–" if reading.noise is None else f"{reading.noise:.3g}{behind_a_number(reading.unit)}".strip()
    return (
        reading.name, _number(reading.raw, reading.raw_unit), _number(reading.value, reading.unit), noise,
        f"{reading.age_s:.1f}", reading.state,
    )  # fmt: skip


def _number(value: float | None, unit: str) -> str:
    return "–" if value is None or not math.isfinite(value) else f"{value:.5g}{behind_a_number(unit)}".strip()


def _kept(stream: IO[str]) -> Callable[[float, Sequence[Reading]], None]:
    """Rows of a recording: time, and each input's value; empty where there is no measurement."""
    import csv

    rows = csv.writer(stream, lineterminator="\n")
    headed: list[bool] = []

    def keep(at_s: float, readings: Sequence[Reading]) -> None:
        if not headed:
            rows.writerow(["time [s]", *(f"{reading.name} [{reading.unit}]" for reading in readings)])
            headed.append(True)
        rows.writerow([f"{at_s:.6g}", *(_cell(reading) for reading in readings)])
        stream.flush()

    return keep


def _cell(reading: Reading) -> str:
    is_known = reading.value is not None and math.isfinite(reading.value) and not reading.is_stale
    return f"{reading.value:.9g}" if is_known else ""


def _as_json(bench: str, readings: Sequence[Reading]) -> str:
    from hil.record.plain import to_json

    return to_json({"schema": "hil.watch/1", "bench": bench, "channels": list(readings)})
