"""What a command found: in words, or as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from hil.record.measurement import Measured


def in_short(m: Measured | None) -> dict[str, Any] | None:
    """A value as comparisons print it: without what stands beside it anyway."""
    return None if m is None else {"value": m.value, "std": m.std, "verdict": m.verdict, "relation": m.relation}


def printed(document: Mapping[str, Any] | list[Any], words: str, as_json: bool, indent: int | None = None) -> None:
    """Print it one way or the other, nothing where there are no words; `document` names its schema."""
    if as_json:
        from hil.record.plain import to_json

        words = to_json(document, indent)
    if words:
        typer.echo(words)
