"""Settings of procedures, and a run from its settings to its findings."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Annotated

import pytest
from annotated_types import Interval
from pydantic import BaseModel

from hil.bench.find import benches
from hil.bench.open import open_rig
from hil.bench.read import read_bench
from hil.catalog import Entry
from hil.errors import FileError, RangeError, SettingError, UnknownNameError
from hil.record.measurement import Limit
from hil.record.read import read_recording
from hil.session.procedure import argument_lines, load_procedure
from hil.session.run import run_procedure
from hil.session.setting import Setting, parse_settings, split_assignments

# on one worker: its run is made once
pytestmark = [pytest.mark.xdist_group("session"), pytest.mark.usefixtures("unprinted")]


@pytest.fixture
def tiny(stranger):
    assert stranger.is_dir()
    return load_procedure("tiny_step")


@pytest.fixture(scope="module")
def bench():
    return read_bench(benches()["brevini-hpv41"])


class Point(BaseModel):
    x: float


@pytest.mark.parametrize(
    ("kind", "given", "says"),
    [
        (float, "inf", "inf s; it must be finite"),
        (Annotated[float, Interval(ge=1.0)], "nan", "nan s; it must be at least 1"),
        (tuple[Annotated[float, Interval(ge=1.0, le=5.0)], ...], "2, 6", "6 s; allowed are 1 to 5"),
        (Annotated[int, Interval(gt=0, lt=5)] | None, 5, "5; it must be above 0 and below 5"),
    ],
)
def test_a_setting_out_of_its_range_says_the_range(kind, given, says):
    with pytest.raises(SettingError, match=f"setting hold_s: {says}"):
        Setting("hold_s", kind, None).parsed(given)


def test_a_setting_may_be_a_table_of_its_own():
    assert Setting("at", Point, None).parsed({"x": "2"}) == Point(x=2.0)


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("levels", "5,10, 20", (5.0, 10.0, 20.0)),
        ("levels", "5", (5.0,)),
        ("levels", "[1, 2]", (1.0, 2.0)),
        ("hold_s", "0.5", 0.5),
        ("limit", "none", None),
        ("limit", "30", 30.0),
        ("repeat", "3", 3),
        ("slow", "yes", True),
        ("slow", "false", False),
        ("kind", "ramp", "ramp"),
    ],
)
def test_text_becomes_a_value_of_the_declared_type(tiny, name, text, value):
    assert parse_settings(tiny.settings, {name: text})[name] == value


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("levels", "5,x", r"setting levels\[1\]: .*number"),
        ("levels", "[1,", r"setting levels"),
        ("hold_s", "0", "it must be above 0"),
        ("repeat", "1.5", "a whole number was expected"),
        ("slow", "perhaps", "yes or no was expected"),
        ("kind", "jump", "expected is one of step | ramp"),
        ("limit", "wide", "number"),
        ("level", "5", "no setting 'level'; the nearest is 'levels'; there are: levels, hold_s"),
        ("colour", "5", "no setting 'colour'; there are: levels, hold_s"),
    ],
)
def test_bad_setting_is_named_alone(tiny, name, text, says):
    with pytest.raises(SettingError, match=says):
        parse_settings(tiny.settings, {name: text})


def test_values_may_be_given_as_they_are(tiny):
    assert parse_settings(tiny.settings, {"levels": (1, 2)})["levels"] == (1.0, 2.0)


@pytest.mark.parametrize("texts", [["levels"], ["=5"], ["hold_s=1", "hold-s=2"]])
def test_assignment_that_is_none(texts):
    with pytest.raises(SettingError):
        split_assignments(texts)


def test_value_may_hold_an_equals_sign():
    assert split_assignments(["a = b=c"]) == {"a": "b=c"}


def test_meaning_of_arguments_is_read_from_the_docstring(tiny):
    assert tiny.settings["levels"].meaning == "where to go, one after the other."
    assert tiny.settings["repeat"].meaning == ""
    assert argument_lines("Text.\n\nArgs:\n    a: one\n    b: two,\n        three\n\nRaises:\n    X: no") == {
        "a": "one", "b": "two, three",
    }  # fmt: skip


def test_unknown_procedure_lists_what_is_installed(stranger):
    with pytest.raises(UnknownNameError, match="did you mean 'tiny_step'"):
        load_procedure("tiny_stepp")


def test_run_leaves_samples_findings_and_verdict(tiny, bench, tmp_path):
    told: list[float] = []
    outcome = run_procedure(
        tiny, bench, {"levels": "50", "repeat": 2}, tmp_path / "run", lambda done, _text: told.append(done)
    )
    assert told == sorted(told) and {0.5, 1.0} <= set(told)
    assert (outcome.findings.verdict, outcome.exit_status) == ("pass", 0)
    found = json.loads((tmp_path / "run" / "results.json").read_text(encoding="utf-8"))
    assert [measured["name"] for measured in found["values"]] == ["rise", "noise"]
    assert outcome.report == tmp_path / "run" / "report.html"
    assert "Brevini HPV41" in outcome.report.read_text(encoding="utf-8")
    run = read_recording(tmp_path / "run")
    assert run.meta["settings"] == {"levels": [50.0], "hold_s": 2.0, "limit": None, "repeat": 2, "slow": False,
                                    "kind": "step"}  # fmt: skip
    assert [part["level"] for part in run.meta["parts"]] == [50.0, 50.0]


def test_what_cannot_be_told_is_exit_status_1_and_nothing_judged_is_0(tiny, bench, tmp_path):
    sure = run_procedure(tiny, bench, {"levels": "50"}, tmp_path / "sure")
    rise = sure.findings.measured[0]
    assert rise.value is not None
    near = run_procedure(tiny, bench, {"levels": "50"}, tmp_path / "near", limits={"rise": Limit(rise.value, None)})
    assert (near.findings.verdict, near.exit_status) == ("cannot tell", 1)
    free = {"rise": Limit(), "noise": Limit()}
    unjudged = run_procedure(tiny, bench, {"levels": "50"}, tmp_path / "free", limits=free)
    assert (unjudged.findings.verdict, unjudged.exit_status) == (None, 0)
    assert json.loads((tmp_path / "free" / "results.json").read_text(encoding="utf-8"))["verdict"] is None
    assert "nothing was judged" in unjudged.report.read_text(encoding="utf-8")


def test_a_run_refused_before_its_first_sample_leaves_its_name_free(tiny, bench, tmp_path):
    def refuse(_rig, **settings):
        raise SettingError(f"setting levels: {settings['levels']}")

    for procedure, settings in ((tiny, {"hold_s": "-1"}), (replace(tiny, run=refuse), {})):
        with pytest.raises(SettingError):
            run_procedure(procedure, bench, settings, tmp_path / "run")
        assert not (tmp_path / "run").exists()
    with pytest.raises(RangeError):  # this one reads the bench before it asks for too much
        run_procedure(tiny, bench, {"levels": "300"}, tmp_path / "run")
    assert len(read_recording(tmp_path / "run")) > 0
    with pytest.raises(FileError, match="exists already"):
        run_procedure(tiny, bench, {}, tmp_path / "run")
    assert len(read_recording(tmp_path / "run")) > 0


def test_outputs_are_safe_and_the_run_closed_before_it_is_evaluated(tiny, bench, tmp_path):
    seen = []

    def evaluate(recording):
        seen.append((recording.meta["outcome"], recording.values("command")[-1]))
        raise FileError("nothing to evaluate")

    with pytest.raises(FileError, match="nothing to evaluate"):
        run_procedure(replace(tiny, evaluate=evaluate), bench, {}, tmp_path / "run")
    assert seen == [("completed", 0.0)]
    assert len(read_recording(tmp_path / "run")) > 4000


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("def run(rig): ...", "has a function 'evaluate'"),
        ("def run(rig, *, x: int): ...\ndef evaluate(recording): ...", "setting 'x' needs a default"),
    ],
)
def test_module_that_is_no_procedure_says_what_it_lacks(tmp_path, monkeypatch, text, says):
    path = tmp_path / f"procedure_{len(text)}.py"
    path.write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    entry = Entry("procedures", path.stem, path.stem, path)
    monkeypatch.setattr("hil.session.procedure.find", lambda _kind, _name: entry)
    with pytest.raises(FileError, match=says):
        load_procedure(path.stem)


def test_an_operator_is_told_of_the_step_that_is_under_way(bench, tmp_path, monkeypatch):
    monkeypatch.setattr("hil.bench.progress_report._EVERY_S", 0.0)
    heard: list[str] = []
    step = load_procedure("step_response")
    with open_rig(bench, tmp_path / "run", {}, lambda _share, text: heard.append(text)) as rig:
        step.run(rig, **parse_settings(step.settings, {"levels": "0,80,0", "hold_s": "1"}))
    for way, command in (("at 0", "command 0.0 %"), ("0 → 80", "command 80.0 %"), ("80 → 0", "command 0.0 %")):
        assert command in [text for text in heard if text.startswith(way)][-1]
