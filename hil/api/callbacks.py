"""Callbacks that a caller may pass, for notes and progress; by default nothing is called."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

Notes = Callable[[str], None]
"""Told what was assumed, a sentence each; `print` will do."""

NOTHING: Mapping[str, Any] = MappingProxyType({})


def unsaid(_note: str) -> None:
    """Keep a note to oneself."""
