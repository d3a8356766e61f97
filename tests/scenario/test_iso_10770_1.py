"""The sequence of ISO 10770-1: it finds what its tests find alone, resumes, and drives only what was planned."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from hil.bench.find import benches
from hil.bench.open import open_rig
from hil.bench.read import BenchFile, read_bench
from hil.errors import FileError, RangeError, SettingError, StoppedError
from hil.language.note import Note
from hil.record.read import read_recording
from hil.session.labels import Labels
from hil.session.procedure import load_procedure
from hil.session.run import run_procedure
from hil.signals.stepped_sine import reference_and_band
from procedures._sequence import SequencedTest, drive

# On one worker: the whole run is made once.
pytestmark = [pytest.mark.xdist_group("sequence"), pytest.mark.usefixtures("unprinted")]
SETTINGS: dict[str, Any] = {
    "cycle_s": 10.0, "steps": (25.0, 50.0), "amplitudes": (10.0,), "biases": (50.0,), "rate_hz": 200.0,
}  # fmt: skip
ALONE: dict[str, dict[str, Any]] = {
    "flow_curve": {"cycle_s": 10.0, "rate_hz": 200.0},
    "step_response": {"levels": (0.0, 25.0, 0.0, -25.0, 0.0, 50.0, 0.0, -50.0, 0.0), "rate_hz": 200.0},
    "frequency_response": {
        "amplitudes": (10.0,),
        "biases": (50.0,),
        "rate_hz": 200.0,
        "frequencies": reference_and_band(4.9),
        "measure_periods": 2,
        "measure_s": 2.0,
    },
    "threshold": {"biases": (50.0,), "rate_hz": 200.0},
    "fail_safe": {"rate_hz": 200.0},
}


@pytest.fixture(scope="module")
def file():
    return read_bench(benches()["brevini-hpv41"])


def ran(file: BenchFile, out: Path, **more: Any) -> Any:
    given = {"settings": SETTINGS, **more}
    return run_procedure(load_procedure("iso_10770_1"), file, out=out, labels=Labels("A7"), **given).findings


@pytest.fixture(scope="module")
def whole(file, tmp_path_factory):
    return ran(file, tmp_path_factory.mktemp("whole") / "run")


def agree(found: Any, other: Any) -> int:
    """Every figure is there in both, and none differs by more than four joint standard uncertainties; how many."""
    assert {m.name for m in found.measured} == {m.name for m in other.measured}
    values = {m.name: m for m in other.measured}
    compared = 0
    for mine in found.measured:
        one = values[mine.name]
        if mine.relation == one.relation == "=" and mine.std and one.std and mine.quantity != "model_fit":
            compared += 1
            assert mine.value == pytest.approx(one.value, abs=4.0 * np.hypot(mine.std, one.std)), mine.name
    return compared


@pytest.mark.parametrize("name", ALONE)
def test_each_test_finds_what_it_finds_alone(file, tmp_path, whole, name):
    alone = run_procedure(load_procedure(name), file, ALONE[name], tmp_path / "alone").findings
    mine = {m.name for m in alone.measured}
    part = type(whole)(tuple(m for m in whole.measured if m.name in mine))
    assert agree(part, alone) >= (0 if name == "threshold" else 3)  # of a valve without friction a bound
    assert set(alone.curves) <= set(whole.curves)
    assert len(alone.deviations) <= len(whole.deviations)


def test_a_run_that_was_broken_off_goes_on_with_the_test_that_was_not_completed(file, tmp_path, whole):
    def stop(_done, text):
        if text.startswith("onward"):
            raise StoppedError("somebody opened the door")

    with pytest.raises(StoppedError):
        ran(file, tmp_path / "broken", progress=stop)
    ended = {p["test"] for p in read_recording(tmp_path / "broken").meta["parts"] if p["kind"] == "test completed"}
    assert ended == {"flow_curve", "step_response", "frequency_response"}
    heard: list[str] = []
    resumed = ran(file, tmp_path / "resumed", settings={}, resume=tmp_path / "broken",
                  progress=lambda _done, text: heard.append(text))  # fmt: skip
    assert any(" left" in text for text in heard) and not any("longer than expected" in text for text in heard)
    assert agree(resumed, whole) > 20
    parts = read_recording(tmp_path / "resumed").meta["parts"]
    assert [p["test"] for p in parts if p["kind"] == "test completed"] == list(ALONE)
    assert sum(p["kind"] == "sweep" for p in parts) == 2  # not driven again


def test_what_was_not_driven_to_its_end_is_said_and_judged_by_nobody(file, tmp_path):
    def stop(_done, text):
        if "sweep of 20" in text:
            raise StoppedError("somebody opened the door")

    with pytest.raises(StoppedError):
        ran(file, tmp_path / "broken", progress=stop)
    procedure = load_procedure("iso_10770_1")
    found = procedure.evaluate(read_recording(tmp_path / "broken"))
    assert not found.measured
    assert [str(note) for note in found.notes] == [
        f"Not done: {name}." for name in ("flow curve", "steps", "frequency response", "threshold", "fail-safe")
    ]


def test_a_test_that_this_bench_cannot_do_is_refused_before_anything_moves(tmp_path):
    bench = read_bench(benches()["hydraforce-open-loop"])
    with pytest.raises(SettingError, match="comes to stand"):
        ran(bench, tmp_path / "run", settings={"tests": ("fail_safe",)})
    assert not (tmp_path / "run").exists()
    with pytest.raises(SettingError, match="setting steps: 150 %"):
        ran(read_bench(benches()["brevini-hpv41"]), tmp_path / "run", settings={"steps": (150.0,)})
    with pytest.raises(SettingError, match="each once"):
        ran(bench, tmp_path / "run", settings={"tests": ("threshold", "threshold")})


def test_tests_of_adjusted_conditions_join_where_the_bench_has_their_roles(tmp_path):
    lab = read_bench(benches()["four-way-lab"])
    names = ("pressure_gain", "flow_over_pressure_drop")
    joined = ran(lab, tmp_path / "run", settings={"tests": names, "rate_hz": 200.0})
    for name in names:
        alone = run_procedure(load_procedure(name), lab, {"rate_hz": 200.0}, tmp_path / name).findings
        assert agree(
            type(joined)(tuple(m for m in joined.measured if m.name in {a.name for a in alone.measured})), alone
        )
    with pytest.raises(SettingError, match='a pressure gain needs an output with role = "load orifice"'):
        ran(read_bench(benches()["brevini-hpv41"]), tmp_path / "hpv41", settings={"tests": ("pressure_gain",)})


def test_nobody_has_to_name_the_tests_of_a_bench(file, tmp_path):
    def stop(_done, text):
        if text.startswith("sweep"):
            raise StoppedError("somebody opened the door")

    named = {}
    for name, bench in (("lab", read_bench(benches()["four-way-lab"])), ("hpv41", file)):
        with pytest.raises(StoppedError):
            ran(bench, tmp_path / name, progress=stop)
        notes = load_procedure("iso_10770_1").evaluate(read_recording(tmp_path / name)).notes
        named[name] = [str(note) for note in notes]
    more = ("pressure gain", "internal leakage", "flow over pressure drop", "limiting power", "null shift", "load step")
    assert named["lab"] == named["hpv41"] + [f"Not done: {name}." for name in more]


def test_multisines_of_a_run_in_which_nobody_named_them_count(file, tmp_path):
    ran(file, tmp_path / "run", settings={**SETTINGS, "tests": ("multisine_response",)})
    recording = read_recording(tmp_path / "run")
    recording.meta["settings"]["tests"] = None  # as runs of earlier versions have it
    found = load_procedure("iso_10770_1").evaluate(recording)
    assert {"bandwidth_3db", "odd_distortion"} <= {one.quantity for one in found.measured}
    assert "Not done: frequency response." not in list(map(str, found.notes))


def procedure(run: Any) -> ModuleType:
    made = ModuleType("procedures.made")
    vars(made)["run"] = run
    return made


def beyond(rig: Any) -> None:
    rig.tighten(-10.0, 10.0)
    rig.expect(1.0)
    rig.play(np.array([0.0, 11.0]), part={"kind": "step"})


def unplanned(rig: Any) -> None:
    rig.play(np.array([0.0, 1.0]))


@pytest.mark.parametrize(("run", "message"), [(beyond, "-10 … 10 % planned"), (unplanned, "drives before it says")])
def test_nothing_is_driven_that_a_test_has_not_planned(file, tmp_path, run, message):
    with pytest.raises(RangeError, match=message), open_rig(file, tmp_path / "run", {}, print) as rig:
        drive(rig, [SequencedTest(procedure(run), Note("made"), {})])
    with pytest.raises(FileError, match="0 samples"):
        read_recording(tmp_path / "run")
