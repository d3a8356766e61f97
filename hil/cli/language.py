"""The option of every command that writes a page: in which language."""

from __future__ import annotations

from typing import Annotated

import typer

from hil.language.choice import choose


def _taken(context: typer.Context, language: str) -> str:
    choose(language)
    context.call_on_close(lambda: choose(""))
    return language


Language = Annotated[
    str,
    typer.Option(
        "--language", metavar="en|de", callback=_taken,
        help="Of pages; else HIL_LANGUAGE, else the environment's. Files for programs are in English.",
    ),
]  # fmt: skip
