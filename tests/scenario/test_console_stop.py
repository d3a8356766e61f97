"""Stop pressed at a console while a run is starting, and where nothing is under way: as pages ask for it."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.parse import urlencode
from urllib.request import HTTPCookieProcessor, Request, build_opener

import pytest

import hil
from tests.consoles import Lab, console, real_time_bench
from tests.faults import watchdogs_of
from tests.outside.coupler import NEAR, Coupler
from tests.outside.running import STRANGER, bench
from tests.waits import PATIENCE_S, until

pytestmark = pytest.mark.xdist_group("console")
BROWSER = build_opener(HTTPCookieProcessor())
FORM = {"procedure": "frequency_response", "bench": "real", "set.frequencies": "1", "set.amplitudes": "10",
        "set.biases": "50", "set.measure_s": "60 s"}  # fmt: skip


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lab")
    real_time_bench(folder)
    with console(folder) as found:
        yield found


def asked(lab: Lab, path: str, fields: Mapping[str, str] | None = None) -> tuple[int, Any]:
    """Status and content of an answer; a POST where there are fields."""
    body = None if fields is None else urlencode(fields).encode()
    headers = {"Origin": lab.address, "Accept": "application/json"}
    try:
        with BROWSER.open(Request(f"{lab.address}{path}", body, headers), timeout=600.0) as answer:
            return answer.status, json.loads(answer.read())
    except HTTPError as error:
        return error.code, json.loads(error.read())


def driven(folder: Path) -> float:
    """How far from its safe value the output of a run ever stood; 0 where it has no sample."""
    samples = folder / "samples.f8"
    if not samples.exists() or not samples.stat().st_size:
        return 0.0
    return float(abs(hil.read(folder).channels["command"].values).max())


def test_press_while_a_run_is_starting_ends_it_before_it_drives(lab):
    _, begun = asked(lab, "/run/start", FORM)
    run = begun["run"]
    (told,) = asked(lab, "/controls")[1]["runs"]
    assert (told["run"], told["state"], told["by"]) == (run, "starting", "console"), "under way from the click"
    _, answer = asked(lab, "/stop", {})
    assert answer["starting"] == [run] and answer["pressed"]["runs"] == [run]
    until(lambda: asked(lab, f"/live/{run}/state")[1]["exit_status"] is not None)
    assert driven(lab.runs / run) == 0.0
    ending = asked(lab, f"/live/{run}/state")[1]["ending"]
    assert ending["word"] == "Stopped" and ending["sentence"].endswith(", before it drove."), ending
    until(lambda: asked(lab, "/controls")[1]["pressed"] is None)  # it ended what it was pressed for

    _, begun = asked(lab, "/run/start", FORM)
    until(lambda: any("stop_url" in one for one in asked(lab, "/controls")[1]["runs"]))
    _, answer = asked(lab, "/stop", {})
    assert answer["answers"][begun["run"]]["state"] == "confirmed" and answer["pressed"] is None


def test_press_where_nothing_is_under_way_keeps_runs_from_starting_until_it_is_released(lab):
    until(lambda: asked(lab, "/controls")[1]["runs"] == [])
    _, answer = asked(lab, "/stop", {})
    assert answer["pressed"]["runs"] == [] and answer["answers"] == {}
    status, told = asked(lab, "/run/start", FORM)
    assert status == 400 and "stop is pressed since" in told["error"] and "release it" in told["error"]
    out = lab.runs / "by hand"
    words = [sys.executable, "-m", "hil", "run", "step_response", "--bench", lab.folder / "real.toml", "--out", out]
    ended = subprocess.run(words, capture_output=True, text=True, timeout=600.0, check=False)
    assert (
        ended.returncode == 138
        and "stopped: stop is pressed since" in ended.stderr
        and "nothing was driven" in ended.stderr
    )
    assert driven(out) == 0.0
    assert asked(lab, "/stop/release", {}) == (200, {"pressed": None})
    assert asked(lab, "/run/start", FORM)[0] == 200
    asked(lab, "/stop", {})


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="looks into /proc")
def test_console_that_is_terminated_leaves_after_its_runs_and_their_watchdogs(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(STRANGER))
    with Coupler() as coupler, console(tmp_path) as lab:
        bench(tmp_path, coupler)
        _, begun = asked(lab, "/run/start", {"procedure": "stand", "bench": "bench"})
        until(lambda: coupler.percent > 20.0)
        coupler.line.lose()
        lab.process.terminate()
        with pytest.raises(subprocess.TimeoutExpired):  # nobody can have made the output safe
            lab.process.wait(3.0)
        assert abs(coupler.percent) > 20.0
        coupler.line.heal()
        lab.process.wait(PATIENCE_S)
        assert abs(coupler.percent) < NEAR
        assert not watchdogs_of(tmp_path)
    assert (lab.runs / begun["run"] / "end.json").exists()
