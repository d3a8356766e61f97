"""Stop, from the POST to what stands at the device: with the run at work, hung, dead, and without a watchdog."""

from __future__ import annotations

import json
import os
import signal
import stat
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from audit_trail import read_audit

from hil.bench.find import find_bench
from hil.bench.read import BenchFile, read_bench
from hil.bench.stop.control import asking
from hil.record.run_folder.events import read_events
from hil.record.run_folder.header import read_end
from hil.safety.interrupt import Halted, terminable
from hil.safety.operator import Operator
from tests import observer
from tests.driven import silent_rig
from tests.faults import STRANGER, start_run
from tests.links import CALM, served
from tests.stops import posted
from tests.waits import PATIENCE_S, until

# The coupler's own watchdog stays off, so that only the program and its watchdog process can make it safe.
CHANGES = (("\nwatchdog_s = 10.0\n", "\n"), ("block_s = 0.1\n", "block_s = 0.1\nwatchdog_s = 10.0\n"))


def written(path: Path) -> dict[str, Any]:
    """What a file says as soon as it is there."""
    until(path.exists)
    return dict(json.loads(path.read_text()))


@contextmanager
def driven(folder: Path) -> Iterator[tuple[subprocess.Popen[str], observer.Watch, dict[str, Any]]]:
    """A run in a process of its own that stands at 40 %, looked at from outside, and its control file."""
    with ExitStack() as stack:
        file, devices = stack.enter_context(served("hpv41-modbus-tcp", folder, *CALM, *CHANGES))
        (device,) = devices.values()
        watch = observer.Watch(observer.modbus_tcp(device.port), 0.6, every_s=0.002)
        stack.callback(watch.close)
        process = stack.enter_context(start_run(file.path, folder / "run", folder / "state"))
        stack.callback(process.kill)
        assert watch.wait(lambda: (watch.now or 0.0) > 39.0, PATIENCE_S)
        yield process, watch, written(folder / "run" / "control.json")


def stop(control: dict[str, Any], account: str = "") -> dict[str, Any]:
    status, answer, _ = posted(control["stop_url"], {"token": control["token"], **asking(account, control)})
    assert status == 200
    return answer


def said_of(answer: dict[str, Any]) -> dict[str, Any]:
    """What an answer says of the command, without the time."""
    return {name: value for name, value in answer["outputs"]["command"].items() if name != "at_utc"}


def confirmed(control: dict[str, Any]) -> dict[str, Any]:
    """Asks as a page does, again until it is confirmed: on a busy machine a takeover takes its time."""
    deadline_s = time.monotonic() + PATIENCE_S
    while (answer := stop(control))["state"] != "confirmed":
        assert time.monotonic() < deadline_s, answer
    return answer


def test_stop_of_a_run_at_work_is_its_own_end(tmp_path):
    with driven(tmp_path) as (process, watch, control):
        mode = stat.S_IMODE((tmp_path / "run" / "control.json").stat().st_mode)
        assert (mode, control["schema"], control["listener"], control["pid"]) == (
            0o600, "hil.control/1", "watchdog", process.pid,
        )  # fmt: skip
        answer = stop(control, "olga ü")
        time.sleep(0.05)
        assert watch.is_safe, "what was called confirmed stands at the device"
        _, err = process.communicate(timeout=PATIENCE_S)
    assert (answer["state"], answer["by"]) == ("confirmed", "run")
    assert said_of(answer) == {"state": "safe", "read_back": True, "at": 0.0, "unit": "%"}
    assert process.returncode == 138
    assert "hil: stopped: stop was pressed; outputs are safe (read back)" in err
    end = read_end(tmp_path / "run")
    assert end.outcome == "Halted: stop was pressed; outputs are safe (read back)"
    assert end.meta["stopped_by"] == "olga ü"
    events, _ = read_events(tmp_path / "run")
    assert [event["details"] for event in events if event["event"] == "stop"] == [{"by": "olga ü"}]
    assert end.outputs == end.meta["outputs"] and said_of({"outputs": end.outputs}) == said_of(answer)
    (trail,) = (tmp_path / "state").rglob("audit*.jsonl")
    stops = [line for line in read_audit(trail) if line["act"] == "stop"]
    assert [(line["account"], line["operator"]) for line in stops] == [("olga ü", "")]
    assert not (tmp_path / "run" / "control.json").exists()
    assert not list((tmp_path / "state").rglob("trips/*")), "nothing is latched"


@pytest.mark.alone
@pytest.mark.slow
@pytest.mark.parametrize("forward_s", [8 * 3600.0, 2**31 / 1000.0, 2.0**32])
@pytest.mark.parametrize("hangs", [False, True], ids=["at work", "hung"])
def test_stop_when_the_clocks_are_set_forward(forward_s, hangs, tmp_path, monkeypatch):
    ahead = tmp_path / "ahead"
    ahead.mkdir()
    (ahead / "sitecustomize.py").write_text(
        f"import time\n_real = time.monotonic\ntime.monotonic = lambda: _real() + {forward_s!r}\n", encoding="utf-8"
    )
    monkeypatch.setattr("tests.faults.STRANGER", f"{STRANGER}{os.pathsep}{ahead}")
    with driven(tmp_path) as (process, watch, control):
        if hangs:
            process.send_signal(signal.SIGSTOP)
        answer = confirmed(control)
        assert watch.wait(lambda: watch.is_safe, PATIENCE_S), answer
        process.wait(PATIENCE_S)
    assert (answer["state"], answer["by"]) == ("confirmed", "watchdog" if hangs else "run")
    assert 0.0 <= answer["seconds"] < 0.85


def test_stop_of_a_run_that_hangs_is_taken_over(tmp_path):
    with driven(tmp_path) as (process, watch, control):
        process.send_signal(signal.SIGSTOP)
        answer = confirmed(control)
        assert watch.wait(lambda: watch.is_safe, PATIENCE_S), answer
        assert process.wait(PATIENCE_S) == -signal.SIGKILL, "it cannot wake up and drive on"
    assert (answer["state"], answer["by"]) == ("confirmed", "watchdog")
    assert said_of(answer) == {"state": "safe", "read_back": True, "at": 0.0, "unit": "%"}
    told = written(tmp_path / "run" / "watchdog.json")
    assert told["why"] == "was told to stop, did not confirm within 0.2 s, and was killed"
    assert said_of(told) == said_of(answer)


def drive_for_ever(file: BenchFile, run: Path) -> None:
    with terminable(), silent_rig(file, run, operator=Operator()) as rig:
        while True:
            rig.play(np.full(1000, 20.0))


def test_stop_of_a_simulated_run_is_heard_by_the_run_itself(tmp_path):
    answers = []

    def press():
        control = written(tmp_path / "run" / "control.json")
        assert (control["listener"], control["pid"]) == ("run", os.getpid())
        time.sleep(0.1)
        answers.append(stop(control))

    file = read_bench(find_bench("brevini-hpv41"))
    pressing = threading.Thread(target=press)
    pressing.start()
    with pytest.raises(Halted):
        drive_for_ever(file, tmp_path / "run")
    pressing.join()
    assert (answers[0]["state"], answers[0]["by"], answers[0]["outputs"]["command"]["at"]) == ("confirmed", "run", 0.0)
    assert not (tmp_path / "run" / "control.json").exists()
