"""The full frequency-response test of the HPV41 paper in virtual time: six runs, evaluated.

    python benchmarks/frequency_response.py

Amplitudes of 5, 10 and 20 % about +50 and −50 %, 0.1 to 4.9 Hz in steps of 0.2 Hz, each sine until it is steady, at
1 kHz through guard, interlocks and 16-bit converters with noise, into a run folder. The peer is the clock on the wall,
which is what the same test takes on a real bench. The bar is 500 times as fast, the goal 5000.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from table import Row, show

from hil.bench.find import find_bench
from hil.bench.read import read_bench
from hil.record.folder import read
from hil.session.procedure import load_procedure
from hil.session.run import evaluate_run, run_procedure

Times = tuple[float, float]


def rows() -> Iterator[Row]:
    procedure = load_procedure("frequency_response")
    bench = read_bench(find_bench("brevini-hpv41"))
    with tempfile.TemporaryDirectory() as folder:
        run_procedure(procedure, bench, {"amplitudes": "10", "frequencies": "1,2,3"}, Path(folder) / "warm-up")
        whole = timed(lambda: run_procedure(procedure, bench, {}, Path(folder) / "run"))
        after = timed(lambda: evaluate_run(procedure, Path(folder) / "run"))
        recording = read(Path(folder) / "run")
    evaluation = timed(lambda: procedure.evaluate(recording))
    bench_s = recording.duration_s
    for name, (wall_s, cpu_s) in {
        "driven and evaluated": add(whole, after, evaluation),
        "driven": add(whole, after),
        "evaluated": evaluation,
        "driven, evaluated, and a report drawn": whole,
    }.items():
        note = f"{bench_s / wall_s:.0f} × real time, {bench_s / cpu_s:.0f} × by processor time"
        yield Row(name, 1e3 * wall_s, f"{note}, bar 500" if name == "driven and evaluated" else note)
    yield Row("on the wall clock", 1e3 * bench_s, f"{len(recording)} samples of {len(recording.channels)} channels")


def timed(call: Callable[[], object]) -> Times:
    """Wall time and processor time of a call, in s."""
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    call()
    return time.perf_counter() - wall_s, time.process_time() - cpu_s


def add(whole: Times, less: Times, plus: Times = (0.0, 0.0)) -> Times:
    """Of both times: whole - less + plus."""
    return whole[0] - less[0] + plus[0], whole[1] - less[1] + plus[1]


def main() -> None:
    show("full frequency-response test of the HPV41", rows())


if __name__ == "__main__":
    main()
