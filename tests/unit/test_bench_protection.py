"""From what a bench file says about limits and interlocks to what the guard enforces."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from hil.bench.file import Bench
from hil.bench.protection import envelopes_of, protection_of
from hil.bench.read import read_bench
from hil.safety.envelope import Dwell, Envelope
from hil.safety.interlock import Band, Interlock
from tests.bench_files import bench_file


def bench(tmp_path: Path, **tables: Any) -> Bench:
    return read_bench(bench_file(tmp_path / "bench.toml", "cummins-efc", **tables)).bench


def test_limits_of_the_file_are_those_of_the_guard(tmp_path):
    limits = {"slew_per_s": 40.0, "dwell": [{"level": 2.0, "longest_s": 5.0}]}
    found = bench(tmp_path, channels={"current": {"limits": limits}})
    assert envelopes_of(found) == {"current": Envelope(0.0, 2.2, 40.0, (Dwell(2.0, 5.0),))}
    assert protection_of(found, 500.0).ramps_per_s == {"current": 10.0}
    assert protection_of(found, 500.0).block_samples(500.0) == 500


@pytest.mark.parametrize(
    ("line", "low", "high"), [({}, -92.0, math.inf), ({"slope": -40.0, "offset": None}, -math.inf, -8.0)]
)
def test_live_zero_is_brought_to_the_unit_of_the_channel(tmp_path, line, low, high):
    found = bench(tmp_path, channels={"pressure": {"calibration": line}})
    (lock,) = [lock for lock in protection_of(found, 1000.0).interlocks if lock.name == "live-zero"]
    assert lock == Interlock("live-zero", "stop", Band("pressure", low, high), for_s=0.05)
