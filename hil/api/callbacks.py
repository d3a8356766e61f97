"""Functions that a caller may hand over to be told things; by default nobody is told."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

Notes = Callable[[str], None]
"""Told what was assumed, a sentence each; `print` will do."""

NOTHING: Mapping[str, Any] = MappingProxyType({})


def unsaid(_note: str) -> None:
    """Keep a note to oneself."""
