"""The full frequency-response test of the HPV41 paper in virtual time: six runs, evaluated.

    python benchmarks/frequency_response.py

Amplitudes of 5, 10 and 20 % about +50 and −50 %, 0.1 to 4.9 Hz in steps of 0.2 Hz, each sine until it is steady, at
1 kHz through guard, interlocks and 16-bit converters with noise, into a run folder. The peer is the clock on the wall,
which is what the same test takes on a real bench. Driven, the bar is 1500 times as fast, as a command with its start
and its page 500; the goal is 5000.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from table import Row, child_s, show

from hil.bench.find import find_bench
from hil.bench.open import open_rig
from hil.bench.read import read_bench
from hil.record.folder import read
from hil.session.procedure import load_procedure
from hil.session.run import run_procedure
from hil.session.setting import parse_settings

REPEATS = 3


def rows() -> Iterator[Row]:
    procedure = load_procedure("frequency_response")
    bench = read_bench(find_bench("brevini-hpv41"))
    with tempfile.TemporaryDirectory() as folder:
        run_procedure(procedure, bench, {"amplitudes": "10", "frequencies": "1,2,3"}, Path(folder) / "warm-up")
        driven_s = min(driven(Path(folder) / f"driven-{k}") for k in range(REPEATS))
        whole_s = timed(lambda: run_procedure(procedure, bench, {}, Path(folder) / "run"))
        recording = read(Path(folder) / "run")
        hil = str(Path(sys.executable).with_name("hil"))
        command_s = child_s(
            [hil, "run", procedure.name, "--bench", "brevini-hpv41", "--out", f"{folder}/command", "--archive", folder]
        )
    evaluated_s = min(timed(lambda: procedure.evaluate(recording)) for _ in range(REPEATS))
    bench_s = recording.duration_s
    for name, cpu_s, bar in (
        ("driven", driven_s, ", bar 1500"),
        ("evaluated", evaluated_s, ""),
        ("driven, evaluated, and a report drawn", whole_s, ""),
        ("hil run frequency_response, from its start", command_s, ", bar 500"),
    ):
        yield Row(name, 1e3 * cpu_s, f"{bench_s / cpu_s:.0f} × real time{bar}")
    yield Row("on the wall clock", 1e3 * bench_s, f"{len(recording)} samples of {len(recording.channels)} channels")


def timed(call: Callable[[], object]) -> float:
    """Processor time of a call, in s."""
    cpu_s = time.process_time()
    call()
    return time.process_time() - cpu_s


def driven(out: Path) -> float:
    """Processor time of the procedure on an open bench, in s."""
    procedure, bench = load_procedure("frequency_response"), read_bench(find_bench("brevini-hpv41"))
    values = parse_settings(procedure.settings, {})
    with open_rig(bench, out, {"settings": values}, lambda _done, _text: None) as rig:
        return timed(lambda: procedure.run(rig, **values))


def main() -> None:
    show("full frequency-response test of the HPV41, by processor time", rows())


if __name__ == "__main__":
    main()
