"""The whole path of a run in virtual time: guard, interlocks, converters, noise, plant, run folder.

    python benchmarks/virtual_time.py

Six stepped sines of 207 s at 1 kHz on the bench `brevini-hpv41` (as many samples as the paper's frequency response),
by the length of the blocks in which inputs are judged and recorded. Processor time beside wall time, because the
machine may be shared.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

from hil.bench.find import find_bench
from hil.bench.open import open_rig
from hil.bench.read import read_bench

RATE_HZ, RUNS, RUN_S = 1000.0, 6, 207.0
BLOCKS_S = (0.1, 1.0, 10.0)


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


def main() -> None:
    bench_s = RUNS * RUN_S
    print(f"{bench_s:g} s of bench time, {round(bench_s * RATE_HZ)} samples of 5 channels, 5 interlocks")
    print(f"{'block s':>8}{'wall s':>9}{'x real time':>13}{'processor s':>13}{'x real time':>13}")
    with tempfile.TemporaryDirectory() as folder:
        for block_s in BLOCKS_S:
            wall_s, cpu_s = measure(Path(folder), block_s)
            print(f"{block_s:8g}{wall_s:9.2f}{bench_s / wall_s:13.0f}{cpu_s:13.2f}{bench_s / cpu_s:13.0f}")


if __name__ == "__main__":
    main()
