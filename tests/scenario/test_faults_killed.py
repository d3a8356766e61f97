"""The program is killed or hangs while it drives: its watchdog process makes the outputs safe at the device.

How soon is judged where nothing else runs: `test_faults_on_links.py`, in `make test-slow`.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil.bench.read import BenchFile
from hil.errors import LinkError, exit_status_of
from hil.errors import with_notes as said
from hil.record.folder import RunWriter
from hil.record.read import read_recording
from hil.record.run_folder.header import read_end
from tests.driven import silent_rig
from tests.faults import Observer, observed, start_run, watchdog_of
from tests.links import served
from tests.waits import PATIENCE_S, until

# The coupler's own watchdog stays off, so that only the watchdog process can make it safe.
TCP = ("hpv41-modbus-tcp", ("watchdog_s = 1.0\n", ""), ("block_s = 0.1", "block_s = 0.1\nwatchdog_s = 1.0"))


@contextmanager
def driven(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], Observer, Path]]:
    bench, *changes = TCP
    with ExitStack() as stack:
        file, devices = stack.enter_context(served(bench, tmp_path, *changes))
        observer = stack.enter_context(observed(devices))
        process = stack.enter_context(start_run(file.path, tmp_path / "run", tmp_path / "state"))
        stack.callback(process.kill)
        observer.wait_until_driven(process)
        time.sleep(0.3)
        yield process, observer, tmp_path / "run"


def told(folder: Path) -> dict[str, Any]:
    until((folder / "watchdog.json").exists)
    time.sleep(0.1)
    return json.loads((folder / "watchdog.json").read_text(encoding="utf-8"))


def test_killed(tmp_path):
    with driven(tmp_path) as (process, observer, folder):
        at_s = time.monotonic()
        process.kill()
        after_s = observer.safe_after(at_s, PATIENCE_S)
        _, err = process.communicate(timeout=PATIENCE_S)
        word = told(folder)  # when nothing late can come any more
    assert after_s is not None
    assert "watchdog" not in err  # a reader of the pipe does not wait for it
    silent = "gave no sign of life for 1 s while outputs were driven, and was killed"  # on a busy machine before we did
    assert word["why"] in ("ended without making its outputs safe", silent) and "safe_after_s" in word
    recording = read_recording(folder)
    assert "not closed" in recording.meta["incomplete"]
    assert recording.values("command")[-1] == 40.0


def test_hangs(tmp_path):
    with driven(tmp_path) as (process, observer, folder):
        at_s = time.monotonic()
        process.send_signal(signal.SIGSTOP)
        after_s = observer.safe_after(at_s, PATIENCE_S)
        process.wait(PATIENCE_S)
        why = told(folder)["why"]
    assert process.returncode == -signal.SIGKILL  # it cannot wake up and drive on
    assert after_s is not None
    assert "gave no sign of life for 1 s while outputs were driven, and was killed" in why


def test_the_watchdog_is_killed(tmp_path):
    with driven(tmp_path) as (process, observer, folder):
        at_s = time.monotonic()
        os.kill(watchdog_of(process.pid), signal.SIGKILL)
        after_s = observer.safe_after(at_s, PATIENCE_S)
        _, err = process.communicate(timeout=PATIENCE_S)
    assert after_s is not None
    assert process.returncode == 3
    assert "the watchdog process ended: killed by SIGKILL; the run was stopped; outputs are safe (read back)" in err
    assert "StoppedError" in read_recording(folder).meta["outcome"]


def test_the_watchdog_hangs(tmp_path):
    with driven(tmp_path) as (process, observer, _folder):
        at_s = time.monotonic()
        watchdog = watchdog_of(process.pid)
        os.kill(watchdog, signal.SIGSTOP)
        try:
            after_s = observer.safe_after(at_s, PATIENCE_S)
        finally:
            with suppress(ProcessLookupError):  # the run has done it
                os.kill(watchdog, signal.SIGKILL)
        _, err = process.communicate(timeout=PATIENCE_S)
    assert after_s is not None
    assert "the watchdog process gave no answer for 1 s; the run was stopped" in err


def test_an_ordered_end_leaves_nothing_to_the_watchdog(tmp_path):
    with driven(tmp_path) as (process, observer, folder):
        at_s = time.monotonic()
        watchdog = watchdog_of(process.pid)
        process.send_signal(signal.SIGINT)
        after_s = observer.safe_after(at_s, PATIENCE_S)
        _, err = process.communicate(timeout=PATIENCE_S)
    assert after_s is not None
    assert (process.returncode, "outputs are safe" in err, "watchdog" in err) == (130, True, False)
    assert not Path(f"/proc/{watchdog}").exists()
    assert not (folder / "watchdog.json").exists()
    assert np.isfinite(read_recording(folder).time_s).all()


def test_a_watchdog_that_cannot_reach_the_device_lets_nothing_move(tmp_path):
    bench, *changes = TCP
    with served(bench, tmp_path, *changes) as (file, _):
        pass
    with start_run(file.path, tmp_path / "run", tmp_path / "state") as process:
        _, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 3
    assert "hil: the watchdog process: " in err and "cannot be reached" in err
    assert not (tmp_path / "run").exists()


def lose(file: BenchFile, run: Path, device: Any) -> None:
    """Drive until the cable is pulled."""
    with silent_rig(file, run) as rig:
        rig.ramp_to(40.0)
        device.answer = lambda _request: b""
        rig.hold(30.0)


def test_a_device_that_comes_back_after_its_run_has_ended_is_made_safe(tmp_path):
    bench, own, _ = TCP
    with served(bench, tmp_path, own) as (file, devices), observed(devices) as observer:
        device = devices["io"].device
        answer = device.answer
        with pytest.raises(LinkError) as lost:
            lose(file, tmp_path / "run", device)
        assert observer.now == pytest.approx(4.0, abs=0.01)  # nobody could reach it
        assert "NOT SAFE: nobody knows where 'command' stands" in said(lost.value)
        assert (read_end(tmp_path / "run").meta["outputs"]["command"]["state"], exit_status_of(lost.value)) == (
            "unknown", 3,
        )  # fmt: skip
        at_s = time.monotonic()
        device.answer = answer
        after_s = observer.safe_after(at_s, PATIENCE_S)
        assert told(tmp_path / "run")["why"] == "ended without making its outputs safe"
    assert after_s is not None


def test_a_check_of_a_driver_that_is_killed_leaves_its_outputs_safe(tmp_path):
    bench, own, _ = TCP
    command = [sys.executable, "-P", "-m", "hil", "check-driver", "modbus", "--hardware", "--bench"]
    environment = {**os.environ, "HIL_STATE_DIR": str(tmp_path / "state")}
    with ExitStack() as stack:
        file, devices = stack.enter_context(served(bench, tmp_path, own))
        observer = stack.enter_context(observed(devices))
        process = stack.enter_context(
            subprocess.Popen(
                [*command, str(file.path)], env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
            )
        )
        observer.wait_until_driven(process)
        process.kill()
        after_s = observer.safe_after(time.monotonic(), PATIENCE_S)
        stood = observer.now
    assert after_s is not None and stood == 0.0


def test_a_lost_device_is_left_to_the_watchdog_before_the_record_is_closed(tmp_path, monkeypatch):
    close, tried = RunWriter.close, []

    def close_on_a_slow_disk(self, *words, **more):
        tried.append(until((tmp_path / "run" / "watchdog-so-far.json").exists))
        close(self, *words, **more)

    monkeypatch.setattr(RunWriter, "close", close_on_a_slow_disk)
    bench, own, _ = TCP
    with served(bench, tmp_path, own) as (file, devices):
        device = devices["io"].device
        answer = device.answer
        with pytest.raises(LinkError):
            lose(file, tmp_path / "run", device)
        device.answer = answer
        told(tmp_path / "run")
    assert tried
