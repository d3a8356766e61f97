"""Writes a run for ever and says, after each block, how many samples are safe: to be killed."""

from __future__ import annotations

import itertools
import os
import sys

import numpy as np

from hil.record.folder import RunWriter

CHANNELS = [("command", "%"), ("flow", "l/min")]


def block(first: int, count: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Samples that depend on their number only."""
    index = np.arange(first, first + count, dtype=float)
    return index / 1000.0, {"command": index % 97.0, "flow": index * 0.5}


def main() -> None:
    path, seed = sys.argv[1], int(sys.argv[2])
    counts = np.random.default_rng(seed).integers(1, 2000, 10_000)
    with RunWriter.create(path, {"seed": seed}, CHANNELS) as run:
        for number in itertools.count():
            with run.part({"kind": "block", "number": number}):
                run.append(*block(run.rows, int(counts[number % len(counts)])))
            run.event("block done", number=number)
            os.write(1, b"%d\n" % run.rows)


if __name__ == "__main__":
    main()
