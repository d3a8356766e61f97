"""What a command found: in words, or as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import typer

Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of words.")]


def printed(told: Mapping[str, Any], words: str, as_json: bool) -> None:
    """Print it one way or the other; `told` names its schema."""
    if as_json:
        from hil.record.plain import to_json

        words = to_json(told)
    typer.echo(words)
