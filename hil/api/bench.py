"""A bench as callers name it: its file, the name of an installed one, or what was read from it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hil.bench.read import BenchFile


def bench_of(bench: str | Path | BenchFile) -> BenchFile:
    """The bench that is meant."""
    from hil.bench.find import find_bench
    from hil.bench.read import read_bench

    return read_bench(find_bench(str(bench))) if isinstance(bench, str | Path) else bench
