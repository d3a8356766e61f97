"""What every benchmark shares: a median time, and the table of times and ratios."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple


class Row(NamedTuple):
    """One way of doing a task: its name, the time it took, and what else there is to say (error, bound, bar)."""

    name: str
    ms: float
    note: str = ""


def milliseconds(function: Callable[[], Any], repeats: int = 15) -> float:
    """Median time of a call, after one to warm up."""
    function()
    taken = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        taken.append(1e3 * (time.perf_counter() - start))
    return statistics.median(taken)


def show(title: str, rows: Iterable[Row]) -> None:
    """Print rows as they come; the ratio is over the first of them, which is ours."""
    print(f"\n{title}\n  {'':48}{'ms':>10}{'ratio':>9}  note", flush=True)
    first = 0.0
    for row in rows:
        first = first or row.ms
        print(f"  {row.name:48}{row.ms:10.3g}{row.ms / first:9.3g}  {row.note}", flush=True)
