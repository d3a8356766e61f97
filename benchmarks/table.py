"""What every benchmark shares: the time of a call, and the table of times and ratios."""

from __future__ import annotations

import resource
import subprocess
import time
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple


class Row(NamedTuple):
    """One way of doing a task: its name, the time it took, and what else there is to say (error, bound, bar)."""

    name: str
    ms: float
    note: str = ""


def milliseconds(
    function: Callable[[], Any], repeats: int = 15, clock: Callable[[], float] = time.process_time
) -> float:
    """The best of several calls, after one to warm up, in processor time unless another clock is given.

    Everything here computes on one thread, so that is the wall time of a machine without neighbours.
    """
    function()
    taken = []
    for _ in range(repeats):
        start = clock()
        function()
        taken.append(1e3 * (clock() - start))
    return min(taken)


def child_s(command: list[str]) -> float:
    """Processor time of a program from its start to its end, in s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, capture_output=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def show(title: str, rows: Iterable[Row]) -> None:
    """Print rows as they come; the ratio is over the first of them, which is ours."""
    print(f"\n{title}\n  {'':48}{'ms':>10}{'ratio':>9}  note", flush=True)
    first = 0.0
    for row in rows:
        first = first or row.ms
        print(f"  {row.name:48}{row.ms:10.3g}{row.ms / first:9.3g}  {row.note}", flush=True)
