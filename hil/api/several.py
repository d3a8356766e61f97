"""One or several of a kind: who hands over a name, a path or a recording by itself means just that one."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

T = TypeVar("T")


def several(given: T | Iterable[T]) -> list[T]:
    """What was given as a list; a text is one name or path, never its letters."""
    if isinstance(given, str) or not isinstance(given, Iterable):
        return [given]
    return list(given)
