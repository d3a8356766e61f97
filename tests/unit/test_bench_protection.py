"""From what a bench file says about limits and interlocks to what the guard enforces."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from hil.bench.file import Bench
from hil.bench.find import benches
from hil.bench.open import open_rig
from hil.bench.protection import envelopes_of, protection_of
from hil.bench.read import read_bench
from hil.errors import StoppedError
from hil.safety.envelope import Dwell, Envelope
from hil.safety.interlock import Band, Interlock

EFC = benches()["cummins-efc"].read_text(encoding="utf-8")


def bench(tmp_path: Path, text: str) -> Bench:
    path = tmp_path / "bench.toml"
    path.write_text(text, encoding="utf-8")
    return read_bench(path).bench


def test_limits_of_the_file_are_those_of_the_guard(tmp_path: Path) -> None:
    text = EFC.replace("high = 2.2 }", "high = 2.2, slew_per_s = 40.0, dwell = [{ level = 2.0, longest_s = 5.0 }] }")
    assert envelopes_of(bench(tmp_path, text)) == {"current": Envelope(0.0, 2.2, 40.0, (Dwell(2.0, 5.0),))}
    assert protection_of(bench(tmp_path, text), 500.0).ramps_per_s == {"current": 10.0}
    assert protection_of(bench(tmp_path, text), 500.0).block_samples(500.0) == 500


@pytest.mark.parametrize(
    ("slope", "low", "high"), [("slope = 40.0, offset = -100.0", -92.0, math.inf), ("slope = -40.0", -math.inf, -8.0)]
)
def test_live_zero_is_brought_to_the_unit_of_the_channel(tmp_path: Path, slope: str, low: float, high: float) -> None:
    text = EFC.replace("slope = 40.0, offset = -100.0", slope).replace("high = 280.0\n", "high = 280.0\n")
    (lock,) = [lock for lock in protection_of(bench(tmp_path, text), 1000.0).interlocks if lock.name == "live-zero"]
    assert lock == Interlock("live-zero", "stop", Band("pressure", low, high), for_s=0.05)


def test_broken_cable_is_noticed_before_anything_moves(tmp_path: Path) -> None:
    broken = EFC.replace("pressure = { noise = 0.5 }", "pressure = { value = -100.0, noise = 0.5 }", 1)
    path = tmp_path / "bench.toml"
    path.write_text(broken, encoding="utf-8")
    with (
        pytest.raises(StoppedError, match="live-zero"),
        open_rig(read_bench(path), tmp_path / "run", {}, lambda _done, _text: None) as rig,
    ):
        rig.play(np.full(100, 1.5))
