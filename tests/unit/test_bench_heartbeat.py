"""What a run says of its watchdog."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from hil.bench.heartbeat import GIVE_UP_S, REPORT_FILE, watched
from hil.errors import DeviceLostError
from tests.links import served


def test_a_run_that_lost_its_device_tells_who_goes_on_and_where_that_is_told(tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    with served("hpv41-modbus-tcp", tmp_path) as (file, _):
        says = rf"^gone; the watchdog process goes on trying for {GIVE_UP_S:g} s .*{run / REPORT_FILE}$"
        with pytest.raises(DeviceLostError, match=says), watched(file, run):
            raise DeviceLostError("gone")
        deadline_s = time.monotonic() + GIVE_UP_S
        while not (run / REPORT_FILE).exists():
            assert time.monotonic() < deadline_s
            time.sleep(0.02)
    assert "safe_after_s" in (run / REPORT_FILE).read_text()
