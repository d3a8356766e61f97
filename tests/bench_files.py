"""Bench files for tests: installed ones with other values."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomlkit

from hil.bench.base import merged
from hil.bench.find import benches


def bench_file(path: Path, bench: str, /, **tables: Any) -> Path:
    """An installed bench with other values, tables merged key by key; a key whose value is None is not there."""
    content = merged(tomllib.loads(benches()[bench].read_text(encoding="utf-8")), tables)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(tomlkit.dumps(_stated(content)), encoding="utf-8")
    return path


def _stated(table: Mapping[str, Any]) -> dict[str, Any]:
    return {key: _stated(value) if isinstance(value, Mapping) else value
            for key, value in table.items() if value is not None}  # fmt: skip
