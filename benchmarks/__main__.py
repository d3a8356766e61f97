"""Every benchmark in one run, one table: `make bench`.

    python benchmarks [NAME]...

Times are in ms; ratios are over the first row of each task, which is ours. What only computes is timed by the processor
and the best of several counts; what starts processes, writes files or runs a test is timed by the clock on the wall.
The load of the machine is printed first, because wall times of a busy machine say less.
"""

from __future__ import annotations

import os
import platform
import sys
from datetime import UTC, datetime
from importlib import import_module

NAMES = (
    "cold_start",
    "identification",
    "black_box",
    "plant",
    "population",
    "fleet",
    "screening",
    "links",
    "pacing",
    "recording",
    "archive",
    "recursive_least_squares",
    "virtual_time",
    "frequency_response",
    "search",
    "mismatch",
)


def main() -> None:
    chosen = sys.argv[1:] or list(NAMES)
    sys.argv[1:] = []
    print(f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC, {processor()}, {os.cpu_count()} cores, "
          f"Python {platform.python_version()}, load {os.getloadavg()[0]:.1f}")  # fmt: skip
    for name in chosen:
        import_module(name).main()


def processor() -> str:
    """What the processor calls itself."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:  # noqa: PTH123
            return next(line.split(": ")[1].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


if __name__ == "__main__":
    main()
