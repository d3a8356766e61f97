"""Where in a TOML file each key stands."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hil.errors import FileError
from hil.untrusted import parse_toml

Place = tuple[str | int, ...]

_MOST_WORK = 20_000_000  # lines × letters: some seconds; a file with more is told its faults without lines


def lines_of(text: str) -> dict[Place, int]:
    """The line on which the statement begins that brought each key of a valid TOML text into being.

    The text is parsed up to every line that ends a statement; what is new then was written since the statement
    before. That is slow and exact: it is asked for only when there is something to complain about.
    """
    found: dict[Place, int] = {}
    lines = text.splitlines()
    if len(lines) * len(text) > _MOST_WORK:
        return found
    begins = 1
    for number in range(1, len(lines) + 1):
        try:
            content = parse_toml("\n".join(lines[:number]), "")
        except FileError:
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
