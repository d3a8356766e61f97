"""`hil jog`: one output to a value and back, in virtual time; values and times as people type them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil.bench.find import benches
from hil.bench.read import BenchFile, read_bench
from hil.cli.quantity import quantity
from hil.errors import HilError, SettingError, UnknownNameError
from hil.record.folder import read
from hil.session.manual_output import output_of, to_be_ended
from hil.session.procedure import load_procedure
from hil.session.run import run_procedure
from tests.bench_files import bench_file

pytestmark = pytest.mark.usefixtures("unprinted")


def _bench(folder: Path, **tables: Any) -> BenchFile:
    return read_bench(bench_file(folder / "bench.toml", "brevini-hpv41", **tables))


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [("2s", "s", 2.0), ("200 ms", "s", 0.2), ("1 min", "s", 60.0), ("50 %", "%", 50.0), ("-3,5", "bar", -3.5),
     ("1e1bar", "bar", 10.0), (".5 V", "V", 0.5), ("100 psi", "bar", 6.894757)],
)  # fmt: skip
def test_quantities_as_people_type_them(text, unit, value):
    assert quantity(text, unit, "VALUE") == pytest.approx(value)


@pytest.mark.parametrize("text", ["", "fast", "1.2.3", "nan", "2 furlongs per", "3 bar", "1e999"])
def test_what_is_no_quantity(text):
    with pytest.raises(SettingError, match="VALUE"):
        quantity(text, "s", "VALUE")


def test_the_output_goes_there_and_back_and_the_run_says_so(tmp_path):
    outcome = run_procedure(
        load_procedure("jog"), _bench(tmp_path), {"value": 30.0, "for_s": 1.0}, tmp_path / "run", commanding="command"
    )
    recording = read(outcome.folder)
    command = recording.values("command", "%")
    assert recording.meta["procedure"] == "jog" and recording.meta["commanding"] == "command"
    assert recording.meta["outputs"]["command"]["state"] == "safe"
    assert command.max() == pytest.approx(30.0, abs=0.01) and recording.meta["outcome"] == "completed"
    (held,) = [part for part in recording.meta["parts"] if part["kind"] == "held"]
    assert held["count"] == round(recording.meta["sampling"]["rate_hz"])
    assert np.all(np.abs(np.diff(command)) <= 100.1)
    found = {m.name: m for m in outcome.findings.measured}
    spool = found["reading, spool position"]
    assert spool.unit == "%" and spool.value == pytest.approx(30.0, abs=0.5) and spool.std and spool.std < 0.5
    assert found["noise, flow"].value == pytest.approx(0.3, abs=0.05)


def test_it_ends_when_it_is_not_wanted_any_more(tmp_path):
    asked = iter(range(10_000))
    mine = to_be_ended(load_procedure("jog"), lambda: next(asked) < 12)
    outcome = run_procedure(mine, _bench(tmp_path), {"value": 30.0, "for_s": 60.0}, tmp_path / "run")
    recording = read(outcome.folder)
    assert recording.time_s[-1] < 5.0 and recording.meta["outputs"]["command"]["state"] == "safe"
    assert "ended by hand" in [event["event"] for event in recording.meta["events"]]


def test_it_ends_at_once_too(tmp_path):
    outcome = run_procedure(
        to_be_ended(load_procedure("jog"), lambda: False), _bench(tmp_path), {"value": 30.0}, tmp_path / "run"
    )
    assert np.all(read(outcome.folder).values("command", "%") == 0.0)
    assert outcome.findings.notes[0] == "The output never stood at its value."


def test_any_output_of_a_bench_and_the_command_stands(tmp_path):
    line = {"device": "daq", "terminal": "do0", "unit": "1", "safe": 0, "on": 1}
    bench = _bench(tmp_path, channels={"enable": line}, simulation={"instruments": {"enable": {"signal": ""}}})
    outcome = run_procedure(
        load_procedure("jog"), bench, {"value": 0.0, "for_s": 0.5}, tmp_path / "run", commanding="enable"
    )
    recording = read(outcome.folder)
    (held,) = [part for part in recording.meta["parts"] if part["kind"] == "held"]
    at = slice(held["first"], held["first"] + held["count"])
    assert np.all(recording.values("enable", "1")[at] == 0.0) and recording.values("enable", "1").max() == 1.0
    assert np.all(recording.values("command", "%") == 0.0) and held["channel"] == "enable"


def test_what_cannot_be_driven(tmp_path):
    bench = read_bench(benches()["brevini-hpv41"])
    with pytest.raises(SettingError, match="'flow' is an input; what can be driven: command"):
        output_of(bench, "flow")
    with pytest.raises(UnknownNameError, match="did you mean 'command'"):
        output_of(bench, "comand")
    with pytest.raises(HilError, match="120"):
        run_procedure(load_procedure("jog"), bench, {"value": 120.0, "for_s": 1.0}, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_command_line(tmp_path, command_line):
    archive = ("--archive", tmp_path)
    where = ("--out", tmp_path / "run", *archive, "--operator", "kb")
    found = command_line("jog", "brevini-hpv41", "command", "-20", "--for", "500 ms", *where)
    assert found.status == 0 and "command stood at -20 %." in found.out, found
    listed = json.loads(command_line("runs", *archive, "--json").out)
    assert [(run["procedure"], run["operator"]) for run in listed] == [("jog", "kb")]
    assert command_line("report", tmp_path / "run").status == 0
