"""A process that records is killed at a random moment: what it said to be safe is there, and nothing is half."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from endless_run import block

from hil.record.folder import read

SCRIPT = Path(__file__).with_name("endless_run.py")


def killed_after(path: Path, seed: int, delay_s: float) -> int:
    """Rows that the process had reported when it was killed, so long after its first block."""
    with subprocess.Popen([sys.executable, str(SCRIPT), str(path), str(seed)], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        first = process.stdout.readline()
        time.sleep(delay_s)
        process.send_signal(signal.SIGKILL)
        rest = process.stdout.read()
    return int((first + rest).rstrip(b"\n").rsplit(b"\n", 1)[-1])


@pytest.mark.parametrize("seed", range(6))
def test_a_kill_at_any_moment_loses_nothing_that_was_flushed(tmp_path, seed):
    delay_s = float(np.random.default_rng(seed).uniform(0.0, 0.15))
    safe = killed_after(tmp_path / "run", seed, delay_s)
    found = read(tmp_path / "run")
    time_s, values = block(0, len(found))
    assert len(found) >= safe
    assert np.array_equal(found.time_s, time_s)
    assert all(np.array_equal(found.channels[name].values, values[name]) for name in values)
    assert "not closed" in found.meta["incomplete"]
    parts = found.meta["parts"]
    assert [part["number"] for part in parts] == list(range(len(parts)))
    assert parts[-1]["first"] + parts[-1]["count"] == len(found)
