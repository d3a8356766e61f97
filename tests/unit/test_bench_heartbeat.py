"""What a run says of its watchdog."""

from __future__ import annotations

import re
import time
from pathlib import Path

import pytest

from hil.bench.heartbeat import GIVE_UP_S, REPORT_FILE, watched
from hil.bench.read import BenchFile
from hil.daq.channel import OutputChannel
from hil.errors import LinkError, told
from hil.safety.outputs import Outputs
from tests.links import PATIENT, served


def lose(file: BenchFile, run: Path, known: Outputs) -> None:
    with watched(file, run, known):
        known.opened({"command": OutputChannel("command", "ao0", "voltage", "V", -10.0, 10.0)})
        raise LinkError("gone")


def test_a_run_that_lost_its_device_tells_who_goes_on_and_where_that_is_told(tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    with served("hpv41-modbus-tcp", tmp_path, *PATIENT) as (file, _):
        known = Outputs()
        with pytest.raises(LinkError) as raised:
            lose(file, run, known)
        says = rf"^gone; the watchdog process goes on trying for {GIVE_UP_S:g} s .*{run / REPORT_FILE}$"
        assert re.match(says, told(raised.value))
        deadline_s = time.monotonic() + GIVE_UP_S
        while not (run / REPORT_FILE).exists():
            assert time.monotonic() < deadline_s
            time.sleep(0.02)
    assert "safe_after_s" in (run / REPORT_FILE).read_text()
