"""A frequency sweep that was broken off goes on at its next point, and finds what an uninterrupted one finds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil.bench.find import benches
from hil.bench.read import BenchFile, read_bench
from hil.errors import FileError, SettingError, StoppedError
from hil.record.read import read_recording
from hil.session.procedure import load_procedure
from hil.session.run import rehearse_procedure, run_procedure

# On one worker: the run that is resumed is made once.
pytestmark = [pytest.mark.xdist_group("resumed runs"), pytest.mark.usefixtures("unprinted")]
SWEEP: dict[str, Any] = {
    "frequencies": "1,2,4,6", "amplitudes": "5,10", "biases": "50", "measure_s": "2", "poles": "2", "zeros": "0",
    "dead_time": "true",
}  # fmt: skip


@pytest.fixture(scope="module")
def file():
    return read_bench(benches()["brevini-hpv41"])


@pytest.fixture(scope="module")
def whole(file, tmp_path_factory):
    """A run that was not broken off."""
    return run_procedure(load_procedure("frequency_response"), file, SWEEP, tmp_path_factory.mktemp("whole") / "run")


def broken_off(file: BenchFile, out: Path, after: int, settings: dict[str, Any] = SWEEP) -> None:
    """A run that ends when so many sines have been measured, as it does when an interlock stops it."""
    heard: set[str] = set()

    def stop(_done: float, text: str) -> None:
        heard.add(text.partition(";")[0] if " Hz, " in text else "")
        if len(heard - {""}) > after:
            raise StoppedError("somebody opened the door")

    with pytest.raises(StoppedError):
        run_procedure(load_procedure("frequency_response"), file, settings, out, stop)


def sines(folder: Path) -> list[tuple[float, float]]:
    parts = read_recording(folder).meta["parts"]
    return [(part["amplitude"], part["frequency_hz"]) for part in parts if part["kind"] == "sine"]


@pytest.mark.parametrize("after", [3, 5])
def test_the_result_is_that_of_an_uninterrupted_run(file, whole, tmp_path, after):
    procedure = load_procedure("frequency_response")
    broken_off(file, tmp_path / "broken", after)
    first = sines(tmp_path / "broken")
    assert len(first) == after

    resumed = run_procedure(procedure, file, {}, tmp_path / "resumed", resume=tmp_path / "broken")
    assert sines(tmp_path / "resumed") == sines(whole.folder)  # each once
    expected = {measured.name: measured for measured in whole.findings.measured}
    assert {measured.name for measured in resumed.findings.measured} == set(expected)
    of_the_valve = [m for m in resumed.findings.measured if m.quantity != "model_fit"]  # that is of the recording
    compared = [m for m in of_the_valve if m.value is not None and m.std and expected[m.name].std]
    assert len(compared) >= 6
    for measured in compared:
        other = expected[measured.name]
        within = 4.0 * np.hypot(measured.std, other.std)
        assert measured.value == pytest.approx(other.value, abs=within), measured.name

    before, after_it = read_recording(tmp_path / "broken"), read_recording(tmp_path / "resumed")
    assert np.array_equal(after_it.values("flow")[: len(before)], before.values("flow"))
    assert after_it.time_s[len(before)] == pytest.approx(before.time_s[-1] + 1.0)
    assert after_it.meta["resumes"] == str(tmp_path / "broken")
    assert after_it.meta["outcome"] == "completed"


def test_the_reference_of_the_standard_needs_what_was_heard_before(file, tmp_path):
    settings = {**SWEEP, "frequencies": "1,3,5,7", "amplitudes": "10", "reference": "standard"}
    procedure = load_procedure("frequency_response")
    run_procedure(procedure, file, settings, tmp_path / "whole")
    broken_off(file, tmp_path / "broken", 2, settings)
    run_procedure(procedure, file, {}, tmp_path / "resumed", resume=tmp_path / "broken")
    (*_, whole_hz), (*_, resumed_hz) = (
        [frequency_hz for _, frequency_hz in sines(tmp_path / name)] for name in ("whole", "resumed")
    )
    assert 0.05 < whole_hz < 1.0
    assert resumed_hz == pytest.approx(whole_hz, rel=0.02)


def test_a_resumed_run_can_be_rehearsed(file, tmp_path):
    procedure = load_procedure("frequency_response")
    broken_off(file, tmp_path / "broken", 6)
    whole = rehearse_procedure(procedure, file, SWEEP)
    rest = rehearse_procedure(procedure, file, {}, resume=tmp_path / "broken")
    assert 0.0 < rest.bench_s < 0.5 * whole.bench_s


def test_what_cannot_be_resumed_says_why(file, tmp_path):
    procedure = load_procedure("frequency_response")
    broken_off(file, tmp_path / "broken", 1)
    out = tmp_path / "out"
    with pytest.raises(SettingError, match="setting poles: a resumed run has the settings with which it began"):
        run_procedure(procedure, file, {"poles": "3"}, out, resume=tmp_path / "broken")
    with pytest.raises(SettingError, match="'step_response' cannot be resumed"):
        run_procedure(load_procedure("step_response"), file, {}, out, resume=tmp_path / "broken")
    with pytest.raises(SettingError, match=r"recorded with another bench file than .*cummins-efc"):
        run_procedure(procedure, read_bench(benches()["cummins-efc"]), {}, out, resume=tmp_path / "broken")
    run_procedure(procedure, file, {}, out, resume=tmp_path / "broken")
    with pytest.raises(FileError, match="completed; there is nothing to resume"):
        run_procedure(procedure, file, {}, tmp_path / "again", resume=out)
