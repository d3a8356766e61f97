"""How long the command line takes to answer, beside an interpreter that only imports what every command needs.

    python benchmarks/cold_start.py

Each in a fresh process, by its processor time, the best of several, because the machine may be shared. The bars are
3 times the import of numpy, typer and pydantic, and for what compiles plants of numba too.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from table import Row, child_s, show

REPEATS = 7
HIL = Path(sys.executable).with_name("hil")
BENCH, MODEL = "brevini-hpv41", "hpv41-identified"


def rows(run: str) -> Iterator[Row]:
    plain, compiled = (_import("numpy, typer, pydantic"), _import("numpy, typer, pydantic, numba"))
    yield Row("python, numpy, typer and pydantic imported", 1e3 * plain)
    yield Row("python, numba imported beside them", 1e3 * compiled)
    commands = {
        "hil --help": (["--help"], plain),
        "hil list": (["list"], plain),
        f"hil check {BENCH}": (["check", BENCH], plain),
        "hil results RUN": (["results", run], plain),
        "hil compare RUN RUN": (["compare", run, run], plain),
        "hil compare --model MODEL RUN": (["compare", "--model", MODEL, run], compiled),
    }
    for name, (arguments, imports) in commands.items():
        took_s = _best([str(HIL), *arguments])
        yield Row(name, 1e3 * took_s, f"{took_s / imports:.2f} × its imports, bar 3")
    for name in ("scipy.signal", "control"):
        yield Row(f"python, {name} imported", 1e3 * _import(name))


def _import(modules: str) -> float:
    return _best([sys.executable, "-c", f"import {modules}"])


def _best(command: list[str]) -> float:
    return min(child_s(command) for _ in range(REPEATS))


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        run = str(Path(folder) / "run")
        subprocess.run(
            [str(HIL), "run", "step_response", "--bench", BENCH, "--out", run, "--archive", folder],
            capture_output=True,
            check=True,
        )
        show("cold start, by processor time", rows(run))


if __name__ == "__main__":
    main()
