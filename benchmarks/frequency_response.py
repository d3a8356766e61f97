"""The full frequency-response test of the HPV41 paper in virtual time: six runs, evaluated and reported.

    python benchmarks/frequency_response.py

Amplitudes of 5, 10 and 20 % about +50 and −50 %, 0.1 to 4.9 Hz in steps of 0.2 Hz, each sine until it is steady, at
1 kHz through guard, interlocks and 16-bit converters with noise, into a run folder. The peer is the clock on the wall,
which is what the same test takes on a real bench. The bar is 500 times as fast, the goal 5000.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from table import Row, show

from hil.bench.find import find_bench
from hil.bench.read import read_bench
from hil.record.folder import read
from hil.session.procedure import load_procedure
from hil.session.run import evaluate_run, run_procedure


def rows() -> Iterator[Row]:
    procedure = load_procedure("frequency_response")
    bench = read_bench(find_bench("brevini-hpv41"))
    with tempfile.TemporaryDirectory() as folder:
        run_procedure(procedure, bench, {"amplitudes": "10", "frequencies": "1,2,3"}, Path(folder) / "warm-up")
        start_s, start_cpu_s = time.perf_counter(), time.process_time()
        run_procedure(procedure, bench, {}, Path(folder) / "run")
        wall_s, cpu_s = time.perf_counter() - start_s, time.process_time() - start_cpu_s
        start_s = time.perf_counter()
        evaluate_run(procedure, Path(folder) / "run")
        evaluation_s = time.perf_counter() - start_s
        recording = read(Path(folder) / "run")
    bench_s, driven_s = recording.duration_s, wall_s - evaluation_s
    yield Row("driven, evaluated, reported", 1e3 * wall_s, f"{bench_s / wall_s:.0f} × real time, bar 500; "
              f"{bench_s / cpu_s:.0f} × by processor time")  # fmt: skip
    yield Row("driven only", 1e3 * driven_s, f"{bench_s / driven_s:.0f} × real time")
    yield Row("evaluated and reported only", 1e3 * evaluation_s)
    yield Row("on the wall clock", 1e3 * bench_s, f"{len(recording)} samples of {len(recording.channels)} channels")


def main() -> None:
    show("full frequency-response test of the HPV41", rows())


if __name__ == "__main__":
    main()
