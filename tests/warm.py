"""`python -m tests.warm`: make what all tests share before they start: compiled plants, classes of valves, bytecode.

Tests beside each other would wait for the same compiler, and each worker would rewrite the assertions of every file.
`make test` runs this beside the static checks, which keep one core busy.
"""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

TESTED_HZ = (1.0, 3.0, 8.0)  # of the short acceptance tests


def compiled(plant: str) -> None:
    """A plant with every effect that fits it."""
    from hil.physics.compose import kernel

    assert kernel(plant).run is not None


def learnt(normally_open: bool) -> None:
    """The classes of EFC valves that the short acceptance tests judge by."""
    from hil.identification.papers.efc_condition import reference_classes

    reference_classes(TESTED_HZ, normally_open)


def collected() -> None:
    """Bytecode of every test file, assertions rewritten, unless all of it is there."""
    if all(_has_bytecode(file) for file in Path(__file__).parent.rglob("test_*.py")):
        return
    subprocess.run([sys.executable, "-m", "pytest", "--collect-only", "-q"], stdout=subprocess.DEVNULL, check=True)


def _has_bytecode(file: Path) -> bool:
    kept = (file.parent / "__pycache__").glob(f"{file.stem}.*-pytest-*.pyc")
    return any(one.stat().st_mtime > file.stat().st_mtime for one in kept)


def main() -> None:
    """All of it, by two processes."""
    from hil.catalog import entries

    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        made = [pool.submit(collected), *(pool.submit(compiled, entry.name) for entry in entries("plants"))]
        made += [pool.submit(learnt, normally_open) for normally_open in (False, True)]
        for one in made:
            one.result()


if __name__ == "__main__":
    main()
