"""Options of every command that reads a recording, and what is printed about how it was read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from hil.record.reading import Reading

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


def options(reading: Reading) -> dict[str, Any]:
    """A reading as the arguments of `hil.read`."""
    return {field.name: getattr(reading, field.name) for field in fields(reading)}


def teller(*, aside: bool = False, kept: list[str] | None = None) -> Callable[[str], None]:
    """What prints notes, none twice.

    Args:
        aside: on stderr, where stdout is read by a program.
        kept: where they are kept too.
    """
    said: list[str] = [] if kept is None else kept

    def tell(note: str) -> None:
        if note not in said:
            said.append(note)
            typer.echo(f"note: {note}", err=aside)

    return tell
