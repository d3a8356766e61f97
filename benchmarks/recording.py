"""Recording 8 channels at 31.25 kS/s in blocks of 20 ms: the run folder against HDF5 (SWMR), TDMS and bare bytes.

    python benchmarks/recording.py [SECONDS]

Each writer gets the same blocks as fast as it takes them and makes each one safe from the death of its process
before the next (HDF5: `flush` each block or, as its users do, each tenth). One table, one run. Bare bytes are numpy's
`tofile`: no names, no checksums, no journal.

Memory is what a process of its own has at its peak beyond what it had after a first second (Linux: VmHWM, reset then),
for a short recording and one that is ten times as long: bounded memory does not grow with length.
"""

from __future__ import annotations

import contextlib
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from table import Row, show

from hil.record.folder import RunWriter, read
from hil.record.recording import Array

CHANNELS, RATE_HZ, BLOCK_S = 8, 31_250.0, 0.02
TURNS = 3
ROWS = round(RATE_HZ * BLOCK_S)
NAMES = [f"channel {i}" for i in range(CHANNELS)]

Append = Callable[[Array, Array], None]
Writer = Callable[[Path], contextlib.AbstractContextManager[Append]]


@contextlib.contextmanager
def run_folder(path: Path) -> Iterator[Append]:
    with RunWriter.create(path, {}, [(name, "V") for name in NAMES]) as run:
        yield lambda time_s, values: run.append(time_s, dict(zip(NAMES, values, strict=True)))


def hdf5_swmr(blocks_per_flush: int) -> Writer:
    @contextlib.contextmanager
    def writer(path: Path) -> Iterator[Append]:
        import h5py

        with h5py.File(path, "w", libver="latest") as file:
            table = file.create_dataset("samples", (0, CHANNELS + 1), maxshape=(None, CHANNELS + 1),
                                        chunks=(ROWS * 10, CHANNELS + 1), dtype="<f8")  # fmt: skip
            file.swmr_mode = True
            number = 0

            def append(time_s: Array, values: Array) -> None:
                nonlocal number
                rows = len(table)
                table.resize(rows + len(time_s), axis=0)
                table[rows:] = np.column_stack([time_s, *values])
                number += 1
                if number % blocks_per_flush == 0:
                    table.flush()

            yield append

    return writer


@contextlib.contextmanager
def tdms(path: Path) -> Iterator[Append]:
    from nptdms import ChannelObject, TdmsWriter

    with path.open("wb") as file, TdmsWriter(file) as out:

        def append(time_s: Array, values: Array) -> None:
            columns = zip(("time", *NAMES), (time_s, *values), strict=True)
            out.write_segment([ChannelObject("recording", name, column) for name, column in columns])
            file.flush()

        yield append


@contextlib.contextmanager
def bare_bytes(path: Path) -> Iterator[Append]:
    with path.open("wb", buffering=0) as file:
        yield lambda time_s, values: np.column_stack([time_s, *values]).tofile(file)


WRITERS: dict[str, Writer] = {
    "run folder": run_folder,
    "HDF5 SWMR, flush each block": hdf5_swmr(1),
    "HDF5 SWMR, flush each 10th": hdf5_swmr(10),
    "TDMS": tdms,
    "bare bytes (numpy tofile)": bare_bytes,
}
WATCHED = ("run folder", "HDF5 SWMR, flush each 10th", "bare bytes (numpy tofile)")


def blocks(seconds: float) -> Iterator[tuple[Array, Array]]:
    """A second of blocks, reused; only the time goes on."""
    values = np.random.default_rng(0).normal(size=(50, CHANNELS, ROWS))
    for i in range(count(seconds)):
        yield (i * ROWS + np.arange(ROWS)) / RATE_HZ, values[i % 50]


def count(seconds: float) -> int:
    return round(seconds / BLOCK_S)


def measure(writer: Writer, path: Path, made: Iterable[tuple[Array, Array]], number: int) -> tuple[float, float]:
    """Seconds of wall time for all blocks (opening and closing included), and p99 of one block in ms."""
    each_s = np.empty(number)
    start_s = time.perf_counter()
    with writer(path) as append:
        for i, block in enumerate(made):
            before_s = time.perf_counter()
            append(*block)
            each_s[i] = time.perf_counter() - before_s
    return time.perf_counter() - start_s, float(np.percentile(each_s, 99)) * 1e3


def writing(seconds: float, folder: Path) -> Iterator[Row]:
    """Every writer in turn, the whole turn several times; the best of each counts, so that neighbours do not."""
    made = list(blocks(seconds))
    best = dict.fromkeys(WRITERS, (float("inf"), float("inf")))
    for turn in range(TURNS):
        for name, writer in WRITERS.items():
            wall_s, p99_ms = measure(writer, folder / f"{name} {turn}", made, len(made))
            best[name] = (min(best[name][0], wall_s), min(best[name][1], p99_ms))
    for name, (wall_s, p99_ms) in best.items():
        yield Row(name, 1e3 * wall_s, f"{seconds / wall_s:.0f} × real time, 99 % of blocks within {p99_ms:.3f} ms")


def memory(seconds: float) -> Iterator[Row]:
    """Blocks are made as they are written."""
    with ProcessPoolExecutor(1, get_context("spawn"), max_tasks_per_child=1) as fresh:
        for name in WATCHED:
            for length_s in (seconds, 10.0 * seconds):
                wall_s, grown_mb = fresh.submit(grown, name, length_s).result()
                written_mb = 8e-6 * (CHANNELS + 1) * ROWS * count(length_s)
                note = f"{written_mb / wall_s:.0f} MB/s of {written_mb:.0f} MB, peak memory grew by {grown_mb:.1f} MB"
                yield Row(f"{name}, {length_s:g} s", 1e3 * wall_s, note)


def grown(name: str, seconds: float) -> tuple[float, float]:
    """Seconds of wall time, and growth of the peak memory."""
    with tempfile.TemporaryDirectory() as folder:
        measure(WRITERS[name], Path(folder, "first"), blocks(1.0), count(1.0))
        reset_peak()
        before_mb = status_mb("VmHWM")
        wall_s, _ = measure(WRITERS[name], Path(folder, "all"), blocks(seconds), count(seconds))
        return wall_s, status_mb("VmHWM") - before_mb


def reset_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def status_mb(field: str) -> float:
    """A size that the kernel keeps of this process."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(f"{field}:")) * 1024e-6


def timed(call: Callable[[], object]) -> float:
    start_s = time.perf_counter()
    call()
    return time.perf_counter() - start_s


def reading(folder: Path) -> Iterator[Row]:
    path = folder / "run folder 0"
    size_mb = (path / "samples.f8").stat().st_size / 1e6
    checked_s = min(timed(lambda: read(path)) for _ in range(TURNS))
    yield Row("run folder, verified", 1e3 * checked_s, f"{size_mb:.0f} MB")
    raw_s = min(timed(lambda: np.fromfile(path / "samples.f8", "<f8")) for _ in range(TURNS))
    yield Row("a bare read of the file", 1e3 * raw_s)


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 30.0
    what = f"{seconds:g} s of {CHANNELS} channels x {RATE_HZ / 1e3:g} kS/s in blocks of {BLOCK_S * 1e3:g} ms"
    with tempfile.TemporaryDirectory() as folder:
        show(f"recording {what}", writing(seconds, Path(folder)))
        show("reading it back", reading(Path(folder)))
    show("memory while recording", memory(seconds / 10.0))


if __name__ == "__main__":
    main()
