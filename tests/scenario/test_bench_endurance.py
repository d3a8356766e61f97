"""An hour of streaming needs no more memory than a minute."""

import tracemalloc

import numpy as np

from hil.record.folder import read
from tests.bench_files import bench_file
from tests.driven import silent_rig

PIECES, PIECE_S, RATE_HZ = 1200, 3, 1000


def test_memory_does_not_grow_with_an_hour_of_streaming(tmp_path):
    time_s = np.arange(PIECE_S * RATE_HZ) / RATE_HZ
    piece = 50.0 + 20.0 * np.sin(2.0 * np.pi * time_s)
    heights = []
    bench = bench_file(tmp_path / "bench.toml", "brevini-hpv41", protection={"block_s": PIECE_S})
    with silent_rig(bench, tmp_path / "run") as rig:
        rig.ramp_to(50.0)
        tracemalloc.start()
        try:
            for i, found in enumerate(rig.stream((piece for _ in range(PIECES)), RATE_HZ, part={"kind": "endurance"})):
                assert len(found) == len(piece)
                if i in (20, PIECES - 1):
                    heights.append(tracemalloc.get_traced_memory()[1])
        finally:
            tracemalloc.stop()
    minute, hour = heights
    assert hour < minute + 1_000_000  # all samples together are 144 MB; a peak counts what other threads happen to hold
    assert hour < 5_000_000
    run = read(tmp_path / "run")
    assert run.meta["parts"][-1]["count"] == PIECES * len(piece)
    assert run.duration_s > 3600.0
