"""The parts of the console that need no browser: what they read, and what they refuse."""

from __future__ import annotations

import asyncio
import json
import logging
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from starlette.datastructures import FormData
from starlette.requests import Request

from hil.archive.place import archive_place
from hil.bench.read import read_bench
from hil.console import board, page
from hil.console import underway as underway_module
from hil.console.board import RunReader, interlocks_of, lines_of
from hil.console.bode import bode_point
from hil.console.console import Console
from hil.console.envelope import Envelope
from hil.console.follow import Follower
from hil.console.form import faults_of, fields_of, given_of, setting_named_in
from hil.console.process import Started, start
from hil.console.routes import bench as bench_routes
from hil.console.routes import results as results_routes
from hil.console.routes import run as run_routes
from hil.console.routes.run import _run_asked
from hil.console.script_words import SCRIPT_MESSAGES
from hil.console.server import OnceAMinute
from hil.console.site import Site
from hil.console.underway import Underway, run_of
from hil.errors import FileError, SettingError, StorageError, UnknownNameError
from hil.findings.results import Results
from hil.record.folder import RunWriter
from hil.record.measurement import RESULTS_FILE
from hil.record.run_folder.header import new_header
from hil.session.procedure import load_procedure


@pytest.fixture(autouse=True)
def looks_each_time(monkeypatch):
    monkeypatch.setattr(underway_module, "_FRESH_S", 0.0)


BENCH = Path("sim_devices/benches/brevini-hpv41.toml").resolve()


@pytest.fixture
def site(tmp_path):
    (tmp_path / "benches").mkdir()
    (tmp_path / "benches" / "own.toml").write_text(BENCH.read_text(encoding="utf-8"), encoding="utf-8")
    runs = tmp_path / "runs"
    runs.mkdir()
    return Site(archive_place(str(runs)), runs, tmp_path / "benches", tmp_path / "state")


def written(folder: Path, seconds: float = 1.0) -> RunWriter:
    file = read_bench(BENCH)
    columns = [(name, entry.unit) for name, entry in file.bench.channels.items()]
    writer = RunWriter(folder, new_header(columns, {"bench": file.bench.name, "procedure": "jog"}))
    time_s = np.arange(round(1000 * seconds)) / 1000.0
    writer.append(time_s, {name: np.sin(6.0 * time_s) for name, _unit in columns})
    return writer


def test_envelope_keeps_the_extremes_of_each_stretch_and_of_the_whole():
    values = np.random.default_rng(1).normal(size=(2, 10_000))
    whole, recent = Envelope(2, 0.01, 100, merges=True), Envelope(2, 0.01, 100, merges=False)
    for first in range(0, 10_000, 130):
        stamps = np.arange(first, min(first + 130, 10_000)) / 1000.0
        whole.take(stamps, values[:, first : first + 130])
        recent.take(stamps, values[:, first : first + 130])
    assert len(whole.start_s) <= 100
    assert np.array_equal(whole.low.min(axis=1), values.min(axis=1))
    assert np.array_equal(whole.high.max(axis=1), values.max(axis=1))
    last = values[0, -10:]
    assert (recent.low[0, -1], recent.high[0, -1]) == (last.min(), last.max())
    assert len(recent.start_s) == 100


def test_envelope_tells_what_was_not_measured_as_nothing():
    seen = Envelope(1, 0.01, 100, merges=False)
    seen.take(np.arange(30) / 1000.0, np.concatenate((np.zeros(10), np.full(10, np.nan), np.full(10, np.inf)))[None])
    assert seen.since(-np.inf)["low"] == [[0.0, None, None]]


def test_bode_point_is_of_a_whole_sine_that_tells_its_response():
    sine = {"kind": "sine", "frequency_hz": 2.0, "amplitude": 5.0, "bias": 50.0, "response": [0.0, -0.1]}
    point = bode_point(sine)
    assert (point["gain_db"], point["phase_deg"]) == (-20.0, -90.0)
    assert bode_point({**sine, "unfinished": True}) is None
    assert bode_point({**sine, "response": [0.0, None]}) is None
    assert bode_point({"kind": "ramp"}) is None


def test_fields_are_those_of_the_signature_and_faults_stand_beside_them():
    procedure = load_procedure("frequency_response")
    fields = {field.name: field for field in fields_of(procedure)}
    assert list(fields) == list(procedure.settings)
    assert fields["measure_s"].unit == "s"
    assert fields["reference"].options == ("lowest", "standard")
    form = {"set.measure_s": "200 ms", "set.tolerance": "many", "set.poles": fields["poles"].default, "set.x": "1"}
    given = given_of(procedure, form)
    assert given == {"measure_s": "200 ms", "tolerance": "many"}
    assert set(faults_of(procedure, given)) == {"tolerance"}
    assert setting_named_in(procedure, "setting measure_periods: 1; at least 2 is allowed") == "measure_periods"


@pytest.mark.parametrize("name", ["../runs/a", "..", ".", "a/b", "/etc", "", "a\x00b", "a\\b", ".hidden"])
def test_site_finds_no_run_outside_its_folder(site, name):
    written(site.runs / "a").close()
    assert site.run("a") == site.runs / "a"
    with pytest.raises(FileError, match="no run"):
        site.run(name)


def test_site_knows_benches_by_name_alone(site):
    assert site.bench("own").bench.name
    with pytest.raises(UnknownNameError):
        site.bench(str(BENCH))


def test_underway_tells_a_run_whose_process_is_gone_as_lost(site):
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    writer = written(site.runs / "a")
    control = {"schema": "hil.control/1", "run": "a", "pid": process.pid, "stop_url": "http://127.0.0.1:1/stop"}
    (site.runs / "a" / "control.json").write_text(json.dumps(control), encoding="utf-8")
    underway = Underway(site.runs)
    assert [run.state for run in underway.look()] == ["running"]
    process.kill()
    os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)  # dead, and not yet buried
    assert [run.state for run in underway.look()] == ["lost"]
    process.wait()
    assert [run.state for run in underway.look()] == ["lost"]
    writer.close()
    assert run_of(site.runs / "a").state == "ended"


def test_underway_leaves_closed_runs_alone_and_finds_new_ones(site, monkeypatch):
    written(site.runs / "old").close()
    underway = Underway(site.runs)
    assert underway.look() == []
    writer = written(site.runs / "new")
    assert [(run.folder.name, run.state) for run in underway.look()] == [("new", "running")]
    writer.close("stopped")
    assert [(run.state, run.outcome) for run in underway.look()] == [("ended", "stopped")]
    monkeypatch.setattr(underway_module, "_ENDED_S", 0.0)
    assert underway.look() == []


def test_follower_tells_every_sample_and_sine_once(tmp_path):
    writer = written(tmp_path / "run")
    follower = Follower(tmp_path / "run")
    first = follower.look()
    assert first["rows"] == 1000
    assert follower.look() is None
    names = [channel["name"] for channel in follower.channels]
    writer.append(np.arange(1000, 1500) / 1000.0, {name: np.full(500, np.nan) for name in names})
    writer.mark(400, {"kind": "sine", "frequency_hz": 1.0, "amplitude": 5.0, "bias": 0.0, "response": [1.0, 0.0]})
    second = follower.look()
    assert (second["rows"], len(second["bode"])) == (1500, 1)
    assert second["values"] == [None] * len(names)
    writer.close()
    over = follower.look()
    assert (over["state"], over["bode"]) == ("ended", [])
    assert follower.finished
    assert len(follower.snapshot()["bode"]) == 1


def test_board_reads_a_run_as_watch_does(tmp_path, monkeypatch):
    file = read_bench(BENCH)
    writer = written(tmp_path / "run")
    reader = RunReader(file, tmp_path / "run")
    lines = {line.name: line for line in lines_of(file, *reader.read())}
    assert lines["flow"].state == "ok"
    assert lines["flow"].value == pytest.approx(np.sin(6.0 * 0.999))
    assert lines["command"].state == "driven"
    locks = {lock["name"]: lock["state"] for lock in interlocks_of(file, list(lines.values()))}
    assert locks["pressure-lost"] == "broken"
    import hil.console.board as board

    now = board.time.monotonic()
    monkeypatch.setattr(board.time, "monotonic", lambda: now + 3.0)
    late = {line.name: line for line in lines_of(file, *reader.read())}
    assert {late[name].tone for name in ("flow", "command")} == {"stale"}
    writer.close()


def test_start_gives_arguments_one_by_one_and_tells_the_last_words(tmp_path):
    made = start("x", ["list", "; touch harmed"], tmp_path / "logs" / "x.log")
    assert made.process.wait(600.0) == 2
    assert "touch harmed" in made.last_line
    assert not list(tmp_path.glob("harmed"))


def test_everything_that_scripts_say_is_in_the_catalogues():
    said = set()
    for script in (Path(page.__file__).parent / "static").glob("*.js"):
        said |= set(re.findall(r'\bsay\("([^"]+)"', script.read_text(encoding="utf-8")))
    assert len(said) > 20
    assert said <= set(SCRIPT_MESSAGES)


def test_a_lean_installation_names_the_extra_in_one_line(monkeypatch, tmp_path, command_line):
    monkeypatch.setenv("HIL_STATE_DIR", str(tmp_path))
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    status, _, said = command_line("console", "--port", "0")
    assert status == 2 and said.count("\n") == 1
    assert "pip install 'valve-hil[console]'" in said


def test_a_certificate_needs_a_serial_number_on_the_form(site):
    console = Console(site, Underway(site.runs))
    own = site.benches / "own.toml"
    own.write_text(own.read_text(encoding="utf-8").replace('serial = "simulated"', 'serial = "ask"'), encoding="utf-8")
    with pytest.raises(SettingError, match="serial"):
        _run_asked(console, {"procedure": "efc_acceptance", "bench": "own"})
    _procedure, _file, arguments = _run_asked(
        console, {"procedure": "step_response", "bench": "own", "serial": "SN 1\r"}
    )
    assert arguments[-1] == "--serial=SN 1"


def _refusing(site: Site) -> Console:
    def full(*_told: object, **_named: object) -> None:
        raise StorageError("the audit trail cannot be written: disk full")

    return Console(site, Underway(site.runs), audit=full)


def test_a_run_that_cannot_be_written_down_is_not_started(site, monkeypatch):
    async def form(_request):
        return {"procedure": "jog", "bench": "own"}

    started = []
    console = _refusing(site)
    monkeypatch.setattr(Console, "of", lambda _request: console)
    monkeypatch.setattr(Console, "start", lambda _self, _arguments, name, _account: started.append(name))
    monkeypatch.setattr(run_routes, "_form", form)
    with pytest.raises(StorageError, match="audit trail"):
        asyncio.run(run_routes.begin(None))  # type: ignore[arg-type]
    assert started == []


def test_a_reset_that_cannot_be_written_down_is_not_done(site, monkeypatch):
    class Request:
        def __init__(self):
            self.path_params, self.headers = {"bench": "own"}, {}

        async def form(self, **_limits):
            return FormData({"interlock": "over-pressure"})

    done = []
    console = _refusing(site)
    monkeypatch.setattr(Console, "of", lambda _request: console)
    monkeypatch.setattr(board, "trips_of", lambda _file: {"over-pressure": "150 bar"})
    monkeypatch.setattr(bench_routes, "reset_trip", lambda _file, name: done.append(name))
    with pytest.raises(StorageError, match="audit trail"):
        asyncio.run(bench_routes.reset(Request()))  # type: ignore[arg-type]
    assert done == []


def test_a_quick_run_whose_process_still_looks_for_a_cause_is_not_said_to_start(site, tmp_path):
    console = Console(site, Underway(site.runs))
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        console.starting["quick"] = Started("quick", process, tmp_path / "log")
        assert [run["state"] for run in console.runs(anew=True)] == ["starting"]
        written(site.runs / "quick").close("completed")
        assert "starting" not in [run["state"] for run in console.runs(anew=True)]
        assert console.starting == {}
        process.communicate(b"\n")


def shown(site: Site, **asked: str) -> dict[str, Any]:
    """What the form of a test shows where its address asks for this."""
    app = SimpleNamespace(state=SimpleNamespace(console=Console(site, Underway(site.runs))))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_routes, "page", lambda _request, _name, **form: form)
        patch.setattr(run_routes, "keep_bench", lambda form, _bench: form)
        return run_routes.show(SimpleNamespace(query_params=asked, app=app))  # type: ignore[arg-type, return-value]


def test_the_form_says_how_far_each_output_may_go(site):
    assert shown(site, bench="own")["allowed"] == ["command −100 … 100 %"]
    (site.benches / "lab.toml").write_text('based_on = "four-way-lab"\n', encoding="utf-8")
    assert shown(site, bench="lab")["allowed"][-1] == "oil temperature 0 … 80 °C"
    assert shown(site, bench="none")["allowed"] == []


@pytest.mark.parametrize(
    ("verdict", "word"),
    [("cannot tell", "Did not end as planned"), (None, "Did not end as planned"), ("fail", "Fail")],
)
def test_results_of_a_run_that_tripped_say_so_in_place_of_a_verdict(site, monkeypatch, verdict, word):
    console = Console(site, Underway(site.runs))
    monkeypatch.setattr(Console, "of", lambda _request: console)
    writer = written(site.runs / "tripped")
    writer.close("TrippedError: over-pressure")
    found = Results(run="tripped", procedure="jog", serial=None, verdict=verdict, values=())
    (site.runs / "tripped" / RESULTS_FILE).write_text(found.as_json(), encoding="utf-8")
    scope = {"type": "http", "method": "GET", "path": "/results/tripped", "query_string": b"", "headers": [],
             "server": ("127.0.0.1", 1), "scheme": "http", "path_params": {"run": "tripped"}}  # fmt: skip
    text = bytes(results_routes.one(Request(scope)).body).decode()
    assert f'<span class="word">{word}</span>' in text


def test_jobs_wait_until_fewer_than_two_are_at_work(site, monkeypatch):
    console = Console(site, Underway(site.runs))
    ready = site.runs / "ready"
    code = f"import pathlib, time\nwhile not pathlib.Path({str(ready)!r}).exists(): time.sleep(0.02)"
    monkeypatch.setattr("hil.child.python", lambda *_: [sys.executable, "-c", code])
    for number in range(4):
        console.begin_job(["diagnose"], f"diagnosis-{number}", "/diagnose/x")
    assert [*console.started] == ["diagnosis-0", "diagnosis-1"] and [*console.waiting] == ["diagnosis-2", "diagnosis-3"]
    ready.touch()
    for name in ("diagnosis-0", "diagnosis-1"):
        assert console.started[name].process.wait(600.0) == 0
    console.tick()
    assert [*console.started][2:] == ["diagnosis-2", "diagnosis-3"] and not console.waiting
    for one in console.started.values():
        one.process.wait(600.0)
    console.waiting.update({f"diagnosis-{number}": ([], "") for number in range(20)})
    with pytest.raises(SettingError, match="20 jobs wait already"):
        console.begin_job(["diagnose"], "diagnosis-20", "/diagnose/x")


def test_same_message_is_logged_once_a_minute(monkeypatch):
    now = [1000.0]
    monkeypatch.setattr("hil.console.server.time.monotonic", lambda: now[0])
    once = OnceAMinute()
    records = [logging.LogRecord("x", logging.WARNING, "", 1, text, (), None) for text in ("one", "one", "two")]
    assert [once.filter(record) for record in records] == [True, False, True]
    now[0] += 61.0
    assert once.filter(records[0])


def test_limits_order_and_oil_of_the_form_reach_the_run(site):
    console = Console(site, Underway(site.runs))
    form = {"procedure": "step_response", "bench": "own", "note.order": " 4711", "note.oil": "",
            "limits": "rise=..0.2 s\n\novershoot=..5 %\n"}  # fmt: skip
    assert _run_asked(console, form)[2][-3:] == ["--note=order=4711", "--limit=rise=..0.2 s", "--limit=overshoot=..5 %"]
    with pytest.raises(SettingError, match="limit 'lap': not measured here"):
        _run_asked(console, {**form, "limits": "lap=0.."})


def test_the_form_is_filled_with_a_preset_of_its_bench(site):
    own = site.benches / "own.toml"
    preset = '\n[presets.step_response.quick]\nlevels = [0, 50]\nhold_s = "3 s"\n'
    own.write_text(own.read_text(encoding="utf-8") + preset, encoding="utf-8")
    filled = shown(site, bench="own", procedure="step_response", preset="quick")
    as_ever = shown(site, bench="own", procedure="step_response", preset="of another procedure")
    values, usual = ({one["name"]: one["value"] for one in form["fields"]} for form in (filled, as_ever))
    assert filled["presets"] == as_ever["presets"] == ["quick"]
    assert {name: value for name, value in values.items() if value != usual[name]} == {"levels": "0,50", "hold_s": "3"}
