"""Where in a TOML file each key stands."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from typing import Any

Place = tuple[str | int, ...]


def lines_of(text: str) -> dict[Place, int]:
    """The line on which the statement begins that brought each key of a valid TOML text into being.

    The text is parsed up to every line that ends a statement; what is new then was written since the statement
    before. That is slow and exact: it is asked for only when there is something to complain about.
    """
    found: dict[Place, int] = {}
    lines = text.splitlines()
    begins = 1
    for number in range(1, len(lines) + 1):
        try:
            content = tomllib.loads("\n".join(lines[:number]))
        except tomllib.TOMLDecodeError:
            continue  # in the middle of a statement
        for place in _places(content):
            found.setdefault(place, begins)
        begins = number + 1
    return found


def line_at(places: dict[Place, int], place: Place) -> int | None:
    """The line of a key, or of the table that it is missing from; None when nothing of it is written."""
    for length in range(len(place), 0, -1):
        if place[:length] in places:
            return places[place[:length]]
    return None


def _places(content: Any, above: Place = ()) -> Iterator[Place]:
    items = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    for key, value in items:
        yield (*above, key)
        yield from _places(value, (*above, key))
