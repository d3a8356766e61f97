"""Options of every command that reads a recording, and what is printed about how it was read."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from hil.identification.experiment import Experiment
    from hil.record.reading import Reading
    from hil.record.recording import Recording
    from hil.record.response_table import ResponseTable

Time = Annotated[str, typer.Option("--time", metavar="NAME", help="Column that holds the time.")]
Interval = Annotated[float, typer.Option("--interval", metavar="S", min=0.0, help="Seconds between samples.")]
Unit = Annotated[list[str], typer.Option("--unit", metavar="NAME=UNIT", help="State a channel's unit: flow=l/min.")]
Rename = Annotated[list[str], typer.Option("--rename", metavar="OLD=NEW", help="Call a channel otherwise.")]
Columns = Annotated[
    str, typer.Option("--columns", metavar="A,B,C", help="Names of the columns in their order; '-' leaves one out.")
]
Gaps = Annotated[bool, typer.Option("--gaps", help="An empty field, or a line cut off, is a sample not taken.")]
Inputs = Annotated[
    list[str], typer.Option("--input", metavar="NAME", help="Input channel, if not called so; again for a second one.")
]
Output = Annotated[str, typer.Option("--output", metavar="NAME", help="Output channel, if not called so.")]


def reading_of(
    time: str, interval: float, unit: Sequence[str], rename: Sequence[str], columns: str, gaps: bool
) -> Reading:
    """The options as the readers take them.

    Raises:
        SettingError: one that is not `NAME=VALUE`.
    """
    from hil.record.named import pairs
    from hil.record.reading import Reading

    return Reading(
        time.strip(), interval, pairs("--unit", unit, "flow=l/min"), pairs("--rename", rename, "ch1=flow"),
        tuple(part.strip() for part in columns.split(",")) if columns.strip() else (), gaps,
    )  # fmt: skip


def notes_on(recordings: Iterable[Recording | ResponseTable], experiments: Iterable[Experiment] = ()) -> list[str]:
    """What was assumed or changed when these were read, a sentence each."""
    said = []
    for one in recordings:
        missing = [f"no unit is stated for '{name}', taken as 1" for name in one.meta.get("units_missing", ())]
        read = [*one.meta.get("assumed", ()), *one.meta.get("unmeasured", ()), *missing]
        said += [f"{one.name}: {sentence}" for sentence in read]
    return [*said, *(note for e in experiments for note in e.notes)]


def say(notes: Iterable[str], *, aside: bool = False) -> None:
    """Print notes; `aside`: on stderr, where stdout is read by a program."""
    for note in dict.fromkeys(notes):
        typer.echo(f"note: {note}", err=aside)


def read_all(paths: Sequence[Path], reading: Reading) -> list[Recording]:
    """Recordings, read with the same options."""
    from hil.record.read import read_recording

    return [read_recording(path, reading) for path in paths]
