"""Arguments and options that several commands share."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from hil.language.choice import choose


def argument(default: Any, metavar: str, help: str, **more: Any) -> Any:
    """An argument as the help shows it; `...` for one that has to be given."""
    return typer.Argument(default, metavar=metavar, help=help, **more)


def option(default: Any, name: str, metavar: str | None = None, help: str = "", **more: Any) -> Any:
    """An option, with what stands behind it in the help; a switch has nothing there."""
    return typer.Option(default, name, metavar=metavar, help=help, **more)


def _taken(context: typer.Context, language: str) -> str:
    choose(language)
    context.call_on_close(lambda: choose(""))
    return language


Archive = Annotated[
    str, typer.Option("--archive", metavar="DIR|URL", help="The archive; else HIL_ARCHIVE, else ./runs.")
]
Bench = Annotated[str, typer.Argument(metavar="BENCH.toml", help="Bench file, or the name of one that is installed.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of words.")]
Language = Annotated[
    str,
    typer.Option(
        "--language", metavar="en|de", callback=_taken,
        help="Of pages; else HIL_LANGUAGE, else the environment's. Files for programs are in English.",
    ),
]  # fmt: skip
Limits = Annotated[
    list[str],
    typer.Option("--limit", metavar="NAME=LOW..HIGH", help="Where a measured value must lie; before all others."),
]
Notes = Annotated[
    list[str], typer.Option("--note", metavar="KEY=VALUE", help="What else is to be known; again for more.")
]
Operator = Annotated[str, typer.Option("--operator", metavar="NAME", help="Who does it; a short mark will do.")]
Part = Annotated[
    str, typer.Option("--part", metavar="NAME", help="Of a run with several frequency responses, this one.")
]
Resets = Annotated[list[str], typer.Option("--reset", metavar="INTERLOCK", help="Reset a trip of this interlock.")]
Serial = Annotated[str, typer.Option("--serial", metavar="SN", help="Serial number of the unit.")]
