"""The lines of an audit trail."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from hil.bench.audit import chain


def read_audit(path: Path) -> Iterator[Mapping[str, Any]]:
    """What its lines say, oldest first. Raises `FileError` as `chain` does."""
    return (link.line for link in chain(path))
