"""How long the command line takes to answer: `hil --help`, `hil list`, beside an interpreter that does nothing.

    python benchmarks/cold_start.py

Each in a fresh process, the best of several, because the machine may be shared. The bar is 0.3 s.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from table import Row, milliseconds, show

REPEATS = 9
HIL = Path(sys.executable).with_name("hil")
COMMANDS = {
    "hil --help": [str(HIL), "--help"],
    "hil list": [str(HIL), "list"],
    "python, nothing imported": [sys.executable, "-c", ""],
    "python -c 'import numpy'": [sys.executable, "-c", "import numpy"],
    "python -c 'import scipy.signal'": [sys.executable, "-c", "import scipy.signal"],
    "python -c 'import control'": [sys.executable, "-c", "import control"],
}


def rows() -> Iterator[Row]:
    for name, command in COMMANDS.items():
        run = partial(subprocess.run, command, capture_output=True, check=True)
        ms = milliseconds(run, REPEATS, time.perf_counter)
        yield Row(name, ms, "bar 300 ms" if name.startswith("hil") else "")


def main() -> None:
    show("cold start", rows())


if __name__ == "__main__":
    main()
