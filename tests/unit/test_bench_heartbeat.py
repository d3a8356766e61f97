"""What a run says of its watchdog."""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from hil.bench.heartbeat import GIVE_UP_S, REPORT_FILE, HeartbeatClient, watched
from hil.bench.read import BenchFile
from hil.errors import LinkError, with_notes
from hil.safety.outputs import Outputs
from hil.system.signals import HOLDING_UP
from tests.channels import outputs
from tests.faults import watchdog_of
from tests.links import PATIENT, served
from tests.waits import until

linux = pytest.mark.skipif(not Path("/proc/self").exists(), reason="looks into /proc")


@pytest.fixture
def run(tmp_path):
    made = tmp_path / "run"
    made.mkdir()
    return made


def wait_for_report(run: Path) -> None:
    until((run / REPORT_FILE).exists, GIVE_UP_S)


def lose(file: BenchFile, run: Path, known: Outputs) -> None:
    with watched(file, run, known):
        known.opened(outputs({"command": "ao0"}))
        raise LinkError("gone")


def test_a_run_that_lost_its_device_tells_who_goes_on_and_where_that_is_told(tmp_path, run):
    with served("hpv41-modbus-tcp", tmp_path, *PATIENT) as (file, _):
        known = Outputs()
        with pytest.raises(LinkError) as raised:
            lose(file, run, known)
        says = rf"^gone; the watchdog process goes on trying for {GIVE_UP_S:g} s .*{run / REPORT_FILE}$"
        assert re.match(says, with_notes(raised.value))
        wait_for_report(run)
    assert "safe_after_s" in (run / REPORT_FILE).read_text()


def lost(file: BenchFile, run: Path, act: Callable[[int], None]) -> str:
    """What a run says that loses its device after something was done to its watchdog."""

    def lose_after() -> None:
        with watched(file, run, known) as watch:
            watch.beat(True)
            known.opened(outputs({"command": "ao0"}))
            act(watchdog_of(run))
            raise LinkError("gone")

    known = Outputs()
    with pytest.raises(LinkError) as raised:
        lose_after()
    return with_notes(raised.value)


@linux
def test_watchdog_that_is_told_to_end_goes_on_trying(tmp_path, run):
    with served("hpv41-modbus-tcp", tmp_path) as (file, _):
        client = HeartbeatClient(file, run)  # each is sent before it can ignore any, too
        for number in HOLDING_UP:
            os.kill(watchdog_of(run), number)
        client.wait_until_ready()
        for number in HOLDING_UP:
            os.kill(watchdog_of(run), number)
        assert f"goes on trying for {GIVE_UP_S:g} s" in client.hand_over()
        wait_for_report(run)


@linux
@pytest.mark.parametrize(
    ("sent", "says"),
    [(signal.SIGSTOP, "goes on trying"), (signal.SIGKILL, "process ended: killed by SIGKILL: nobody goes on trying")],
)
def test_watchdog_that_was_paused_is_woken_and_of_a_dead_one_nothing_is_promised(sent, says, tmp_path, run):
    with served("hpv41-modbus-tcp", tmp_path) as (file, _):
        assert says in lost(file, run, lambda watchdog: os.kill(watchdog, sent))
        if sent == signal.SIGSTOP:
            wait_for_report(run)
