"""One or several of a kind: who hands over a name, a path or a recording by itself means just that one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TypeVar, cast

from hil.errors import SettingError

T = TypeVar("T")


def several(given: T | Iterable[T]) -> list[T]:
    """What was given as a list; a text is one name or path, never its letters, a table one, never its columns."""
    if isinstance(given, str | Mapping) or hasattr(given, "columns") or not isinstance(given, Iterable):
        return [cast("T", given)]
    return list(given)


def at_least_one(given: T | Iterable[T]) -> list[T]:
    """The same where nothing can be made of none; raises `SettingError` for that."""
    found = several(given)
    if not found:
        raise SettingError("none is given; at least one recording, run or table is needed")
    return found
