"""Options of every command that reads a recording, and what is printed about how it was read."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import wraps
from typing import Annotated, Any

import typer

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
    from hil.record.table.named import pairs

    return Reading(
        time.strip(), interval, pairs("--unit", unit, "flow=l/min"), pairs("--rename", rename, "ch1=flow"),
        tuple(part.strip() for part in columns.split(",")) if columns.strip() else (), gaps,
    )  # fmt: skip


_OPTIONS: dict[str, tuple[Any, Any]] = {
    "time": (Time, ""), "interval": (Interval, 0.0), "unit": (Unit, []), "rename": (Rename, []),
    "columns": (Columns, ""), "gaps": (Gaps, False),
}  # fmt: skip


def takes_reading(command: Callable[..., None]) -> Callable[..., None]:
    """A command for typer, with the options of reading in place of its parameter `reading`.

    typer reads a command's signature: it is made here, so that each command states the reading it takes and no option.
    """

    @wraps(command)
    def taking(**given: Any) -> None:
        options_given = {name: given.pop(name) for name in _OPTIONS}
        command(**given, reading=reading_of(**options_given))

    own = [p for p in inspect.signature(command, eval_str=True).parameters.values() if p.name != "reading"]
    read = [inspect.Parameter(n, _NAMED, annotation=kind, default=first) for n, (kind, first) in _OPTIONS.items()]
    taken = [*(p.replace(kind=_NAMED) for p in own), *read]
    taking.__signature__ = inspect.Signature(taken)  # type: ignore[attr-defined]
    taking.__annotations__ = {p.name: p.annotation for p in taken}
    return taking


_NAMED = inspect.Parameter.KEYWORD_ONLY


def options(reading: Reading) -> dict[str, Any]:
    """A reading as the arguments of `hil.read`."""
    return {field.name: getattr(reading, field.name) for field in fields(reading)}


def teller(*, aside: bool, kept: list[str] | None = None) -> Callable[[str], None]:
    """What prints notes, none twice.

    Args:
        aside: on stderr, where stdout is read by a program.
        kept: where they are kept too.
    """
    printed: list[str] = [] if kept is None else kept

    def tell(note: str) -> None:
        if note not in printed:
            printed.append(note)
            typer.echo(f"note: {note}", err=aside)

    return tell
