"""What a command found: in words, or as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import typer

Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of words.")]


def printed(document: Mapping[str, Any], words: str, as_json: bool) -> None:
    """Print it one way or the other; `document` names its schema."""
    if as_json:
        from hil.record.plain import to_json

        words = to_json(document)
    typer.echo(words)
