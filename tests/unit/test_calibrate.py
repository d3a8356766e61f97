"""`hil calibrate`: points of an input and of an output, what is said of them, and what is written."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from hil.bench.file import CalibrationLine
from hil.bench.manual.write import changed
from hil.bench.read import read_bench
from hil.clock import RealClock
from hil.record.folder import read
from hil.session.calibration import input_points
from tests.conftest import Told
from tests.links import PATIENT, bench_text, served

pytestmark = pytest.mark.usefixtures("unprinted")


def _bench(folder: Path) -> Path:
    path = folder / "bench.toml"
    path.write_text(bench_text("brevini-hpv41"), encoding="utf-8")
    return path


Calibrated = Callable[..., Told]


@pytest.fixture
def calibrated(command_line, tmp_path):
    """How `hil calibrate` of the command ended that was answered so."""

    def run(typed, *more):
        stated = ("--reference", "meter 7, 2026-03", "--reference-uncertainty", "0.4 %", "--operator", "kb")
        where = ("--out", tmp_path / "run", "--archive", tmp_path)
        return command_line("calibrate", _bench(tmp_path), "command", *stated, *where, *more, typed=typed)

    return run


def test_an_output_is_driven_to_each_point_and_the_line_written(calibrated, tmp_path):
    found = calibrated("-90.1\n-44.9\n0,1\nfast\n45.1 %\n89.9\ny\n", "--between", "-90..90")
    assert found.status == 0, found
    assert "again: " in found.err and "residual +0.08 %" in found.out and "written into" in found.out
    entry = read_bench(tmp_path / "bench.toml").bench.channels["command"]
    new = entry.calibration
    assert new is not None and new.slope == pytest.approx(10.0, abs=0.03) and new.operator == "kb"
    assert new.source == "meter 7, 2026-03" and new.due and new.date and (new.due - new.date).days == 365
    assert entry.limits and entry.limits.low == -99.98 and "limits.low becomes -99.98 %" in found.out
    assert new.uncertainty and 0.4 < new.uncertainty < 0.9 and entry.calibration_history[0].slope == 10.0
    run = read(tmp_path / "run")
    held = [part for part in run.meta["parts"] if part["kind"] == "held"]
    assert [part["to"] for part in held] == [-90.0, -45.0, 0.0, 45.0, 90.0]
    assert run.meta["outputs"]["command"]["state"] == "safe" and (tmp_path / "run" / "report.html").is_file()


def test_the_line_is_written_as_a_person_would_with_comments_kept():
    text = '[channels.a]\nunit = "bar"\ncalibration = { offset = 1.0, slope = 25.0, uncertainty = 3.0 }   # old gauge\n'
    old, new = (CalibrationLine.model_validate(line) for line in (
        {"slope": 25.0, "offset": 1.0}, {"slope": 25.25, "offset": 0.5, "date": "2026-11-25", "source": "gauge 7"},
    ))  # fmt: skip
    assert changed(text, "a", new, old, {}).splitlines()[2] == (
        'calibration = {offset = 0.5, slope = 25.25, date = 2026-11-25, source = "gauge 7"}   # old gauge'
    )


def test_not_confirmed_is_not_written_and_json_says_so(calibrated, tmp_path):
    found = calibrated("-50\n50.2\nn\n", "--points", "2", "--between", "-50..50", "--json")
    told = json.loads(found.out)
    assert told["schema"] == "hil.calibrate/1" and not told["written"]
    assert told["line"]["slope"] == pytest.approx(10.02) and told["line"]["offset"] == pytest.approx(0.1)
    assert (tmp_path / "bench.toml").read_text(encoding="utf-8") == bench_text("brevini-hpv41")


def test_an_input_that_ends_early_leaves_the_output_safe_and_the_file_as_it_was(calibrated, tmp_path):
    found = calibrated("-50\n", "--between", "-50..50")
    assert found.status == 3
    assert read(tmp_path / "run").meta["outputs"]["command"]["state"] == "safe"
    assert (tmp_path / "bench.toml").read_text(encoding="utf-8") == bench_text("brevini-hpv41")


def test_beyond_the_limits_nothing_is_driven(calibrated, tmp_path):
    found = calibrated("1\n2\n", "--between", "0..120", "--points", "2")
    assert found.status != 0
    assert max(read(tmp_path / "run").values("command", "%")) <= 100.0


def test_the_bench_of_a_package_is_not_changed_and_nothing_is_driven(command_line, tmp_path):
    stated = ("--reference", "meter 7", "--out", tmp_path / "run")
    found = command_line("calibrate", "brevini-hpv41", "command", *stated, typed="1\n2\n")
    assert found.status == 2 and 'based_on = "brevini-hpv41"' in found.err
    assert not (tmp_path / "run").exists()


class Ahead(RealClock):
    """A clock that is turned on."""

    by_s = 0.0

    @property
    def now_s(self) -> float:
        return super().now_s + self.by_s


def test_an_input_is_averaged_at_each_point(tmp_path):
    """The valve is moved by hand behind the device; the reference reads what the plant really does."""
    with served("hpv41-modbus-tcp", tmp_path, *PATIENT) as (file, devices):
        (device,) = devices.values()
        ahead = device.side.field.clock = Ahead()
        places = iter([-40.0, 0.0, 40.0])
        places_v = iter([-4.0, 0.0, 4.0])

        def ask(_text):
            device.side.drive({"ao0": next(places_v)})
            ahead.by_s += 2.0  # the spool takes its time

        points = input_points(file, "spool position", 3, ask, lambda: next(places))
        assert [point.reference for point in points] == [-40.0, 0.0, 40.0]
        assert [12.5 * point.raw for point in points] == pytest.approx([-40.0, 0.0, 40.0], abs=1.0)
        assert all(0.0 < point.raw_std < 0.02 for point in points)


def test_an_input_that_does_not_follow_is_no_line(tmp_path, command_line):
    told = ("calibrate", _bench(tmp_path), "flow", "--reference", "cylinder", "--points", "3")
    found = command_line(*told, typed="0\n10\n20\ny\n")
    assert found.status == 2 and "did not move" in found.err
