"""The whole path of a run in virtual time: guard, interlocks, converters, noise, plant, run folder.

    python benchmarks/virtual_time.py

Six stepped sines of 207 s at 1 kHz on the bench `brevini-hpv41` (as many samples as the paper's frequency response),
by the length of the blocks in which inputs are judged and recorded. Processor time beside wall time, because the
machine may be shared.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as `hil` itself does

import numpy as np
from table import Row, show

from hil.bench.find import find_bench
from hil.bench.open import open_rig
from hil.bench.read import read_bench

RATE_HZ, RUNS, RUN_S = 1000.0, 6, 207.0
BENCH_S = RUNS * RUN_S
BLOCKS_S = (1.0, 0.1, 3.0)


def stepped_sine() -> list[np.ndarray]:
    frequencies_hz = np.arange(0.1, 5.0, 0.2)
    periods_s = 8.0 / frequencies_hz
    periods_s *= RUN_S / periods_s.sum()
    times_s = [np.arange(round(RATE_HZ * duration_s)) / RATE_HZ for duration_s in periods_s]
    return [50.0 + 10.0 * np.sin(2.0 * np.pi * f * t) for f, t in zip(frequencies_hz, times_s, strict=True)]


def measure(folder: Path, block_s: float) -> tuple[float, float]:
    bench = folder / f"{block_s:g}.toml"
    text = find_bench("brevini-hpv41").read_text(encoding="utf-8")
    bench.write_text(text.replace("block_s = 1.0", f"block_s = {block_s}"), encoding="utf-8")
    levels = stepped_sine()
    with open_rig(read_bench(bench), folder / f"run {block_s:g}", {}, lambda _done, _text: None) as rig:
        rig.ramp_to(50.0)
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        for _ in range(RUNS):
            for level in levels:
                rig.play(level, part={"kind": "sine"})
        return time.perf_counter() - wall_s, time.process_time() - cpu_s


def rows() -> Iterator[Row]:
    with tempfile.TemporaryDirectory() as folder:
        for block_s in BLOCKS_S:
            wall_s, cpu_s = measure(Path(folder), block_s)
            note = f"{BENCH_S / wall_s:.0f} × real time; {BENCH_S / cpu_s:.0f} × by processor time"
            yield Row(f"blocks of {block_s:g} s", 1e3 * wall_s, note)


def main() -> None:
    show(f"{BENCH_S:g} s of bench time, {round(BENCH_S * RATE_HZ)} samples of 5 channels, 5 interlocks", rows())


if __name__ == "__main__":
    main()
