"""`hil run` and `hil check` as an operator meets them: every way in which a run can end."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from hil.errors import FileError
from hil.record.read import read_recording
from tests.bench_files import bench_file
from tests.waits import until

REAL_TIME = {"devices": {"daq": {"time": "real"}}, "protection": {"block_s": 0.05}}
STRANGER = Path(__file__).parents[1] / "stranger"
Told = Callable[..., tuple[int, str, str]]  # exit status, stdout, stderr


def start(
    *arguments: str | Path, prepare: Callable[[], None] | None = None, cwd: Path | None = None
) -> subprocess.Popen[str]:
    environment = {**os.environ, "PYTHONPATH": str(STRANGER)}
    command = [sys.executable, "-m", "hil", *map(str, arguments)]
    return subprocess.Popen(
        command, env=environment, cwd=cwd, preexec_fn=prepare, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def run(*arguments: str | Path, prepare: Callable[[], None] | None = None, cwd: Path | None = None):
    process = start(*arguments, prepare=prepare, cwd=cwd)
    out, err = process.communicate(timeout=600)
    return process.returncode, out, err


@pytest.fixture
def told(command_line, stranger):
    """`run`, but by the program's entry point within this process: for ends that no process need be watched at."""
    return command_line


def test_a_run_that_passes(tmp_path):
    status, out, err = run("run", "tiny_step", "--bench", "brevini-hpv41", "--set", "levels=50", cwd=tmp_path)
    assert status == 0
    told = err.splitlines()  # on a busy machine followed by the word that the archive takes its time
    assert "100%  outputs safe; evaluating" in told and any("%  round 1; command 50.0 %" in line for line in told)
    (folder,) = (tmp_path / "runs").iterdir()
    assert folder.name.startswith("tiny_step-2") and f"recording into runs/{folder.name}" in out
    assert "rise " in out and "± " in out and "verdict: pass" in out
    assert json.loads((folder / "results.json").read_text(encoding="utf-8"))["verdict"] == "pass"


@pytest.mark.parametrize(
    ("changes", "settings", "status", "says"),
    [
        ({}, ["levels=5"], 1, ""),
        ({}, ["levels=500"], 2, "500 % is outside -100 … 100 %"),
        ({"interlocks": {"over-pressure": {"high": 90.0}}}, [], 3, "interlock 'over-pressure'"),
        ({"simulation": {"plant": 3}}, [], 2, "simulation.plant: input should be a valid string"),
        ({"devices": {"daq": {"fault": {"kind": "lost", "after": 3000}}}}, [], 3, "use the emergency stop"),
        ({"devices": {"daq": {"fault": {"kind": "overrun", "after": 3000}}}}, [], 3, "overwritten before it was read"),
    ],
)
def test_each_end_has_its_exit_status_and_one_line(told, tmp_path, changes, settings, status, says):
    options = [option for setting in settings for option in ("--set", setting)]
    file = bench_file(tmp_path / "bench.toml", "brevini-hpv41", **changes)
    found, _, err = told("run", "tiny_step", "--bench", file, "--out", tmp_path / "run", *options)
    assert found == status
    lines = [line for line in err.splitlines() if line.startswith("hil: ")]
    assert (len(lines) == 1 and says in lines[0]) if says else not lines


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_stopped_by_a_signal_while_driving(tmp_path, number, status):
    folder = tmp_path / "run"
    file = bench_file(tmp_path / "bench.toml", "brevini-hpv41", **REAL_TIME)
    with start("run", "tiny_step", "--bench", file, "--out", folder, "--set", "hold_s=60") as process:
        try:
            until(lambda: _last(folder) == 40.0)
            process.send_signal(number)
            process.send_signal(number)  # an impatient operator does not disturb the way down
            _, err = process.communicate(timeout=600)
        finally:
            process.kill()
    assert process.returncode == status
    assert f"hil: stopped; outputs are safe (read back); what was recorded is kept in {folder}" in err
    recording = read_recording(folder)
    command = recording.values("command")
    assert command[-1] == 0.0
    assert np.abs(np.diff(command[command.argmax() :])).max() <= 0.2 + 1e-9  # down the ramp of 200 %/s
    assert recording.meta["parts"][-1]["unfinished"]
    assert "Interrupt" in recording.meta["outcome"] or "Terminated" in recording.meta["outcome"]


def test_check_lists_every_fault(told, tmp_path):
    file = bench_file(tmp_path / "bench.toml", "brevini-hpv41", devices={"daq": {"skw": 1}},
                      channels={"flow": {"terminal": "ai99"}})  # fmt: skip
    status, out, err = told("check", file)
    assert status == 2
    assert [line.split(": ")[1] for line in out.splitlines()] == ["devices.daq.skw", "channels.flow.terminal"]
    assert err == f"hil: {file}: 2 faults\n"


def test_check_of_a_good_bench_shows_it(told):
    status, out, err = told("check", "cummins-efc")
    assert (status, err) == (0, "")
    assert "pwm0  current (command): 0 … 3 A, limits 0 … 2.2, safe at 0" in out


def test_describe_needs_no_bench(told):
    status, out, _ = told("run", "tiny_step", "--describe")
    assert status == 0
    assert "--set kind: step | ramp = step" in out and "rise [l/min]: response to the step" in out


def test_usage_without_a_bench(told):
    status, _, err = told("run", "tiny_step")
    assert status == 2 and "--bench" in err


def _last(folder: Path) -> float | None:
    """Where the command stood last; None where the run is not made yet, or without samples."""
    with suppress(FileError):
        return float(read_recording(folder).values("command")[-1])
    return None
