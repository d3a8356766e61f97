"""The line of a calibration: intervals that hold, residuals that tell, a bench file that keeps its comments."""

from __future__ import annotations

import datetime as dt
import tomllib

import numpy as np
import pytest

from hil.bench.file import CalibrationLine
from hil.bench.manual.fit import Line, Point, fit_line
from hil.bench.manual.write import write_calibration
from hil.bench.read import read_bench
from hil.errors import FileError, SettingError
from tests.links import bench_text

SLOPE, OFFSET, REFERENCE_STD, RAW_STD = 25.0, -3.0, 0.4, 0.01


def _calibrated(seed: int, count: int, stated: float | None, bend: float = 0.0) -> Line:
    random = np.random.default_rng(seed)
    true = np.linspace(0.0, 10.0, count)
    raw = true + RAW_STD * random.standard_normal(count)
    told = SLOPE * true + OFFSET + bend * true**2 + REFERENCE_STD * random.standard_normal(count)
    points = [Point(float(r), RAW_STD, float(t)) for r, t in zip(raw, told, strict=True)]
    return fit_line(points, stated)


@pytest.mark.parametrize(("count", "stated"), [(5, REFERENCE_STD), (11, REFERENCE_STD), (5, None), (2, REFERENCE_STD)])
def test_intervals_hold_the_truth_as_often_as_they_say(count, stated):
    lines = [_calibrated(seed, count, stated) for seed in range(300)]
    slopes = np.mean([abs(line.slope - SLOPE) <= line.slope_interval for line in lines])
    offsets = np.mean([abs(line.offset - OFFSET) <= line.offset_interval for line in lines])
    assert 0.93 <= slopes <= 0.97 and 0.93 <= offsets <= 0.97, (slopes, offsets)
    assert np.mean([line.exceeds for line in lines]) <= 0.03


def test_a_channel_that_is_bent_is_told():
    lines = [_calibrated(seed, 7, REFERENCE_STD, bend=0.5) for seed in range(20)]
    assert all(line.exceeds and line.non_linearity > 3.0 for line in lines)
    assert all(line.uncertainty > 2.0 * line.non_linearity / np.sqrt(3.0) for line in lines)


def test_a_value_read_through_the_line_lies_within_its_uncertainty():
    """Both parts: the line, and the reference once more."""
    lines = [_calibrated(seed, 5, REFERENCE_STD) for seed in range(300)]
    inside = [abs(line.slope * 7.0 + line.offset - SLOPE * 7.0 - OFFSET) <= line.uncertainty for line in lines]
    assert np.mean(inside) >= 0.95


def test_readings_on_a_line_leave_nothing():
    points = [Point(raw, RAW_STD, 10.1 * raw + 0.2) for raw in (-10.0, -5.0, 0.0, 5.0, 10.0)]
    assert fit_line(points, REFERENCE_STD).residuals == (0.0,) * 5


def test_what_is_no_line():
    with pytest.raises(SettingError, match="three without"):
        fit_line([Point(0.0, 0.0, 0.0), Point(1.0, 0.0, 1.0)])
    with pytest.raises(SettingError, match="did not move"):
        fit_line([Point(1.0, 0.01, float(i)) for i in range(5)], 0.1)


NEW = CalibrationLine(slope=24.5, offset=-1.5, uncertainty=0.8, date=dt.date(2026, 11, 25), due=dt.date(2027, 11, 25),
                      source="dead weight tester 7", operator="kb")  # fmt: skip


def test_a_bench_file_keeps_its_comments_and_what_it_said_before(tmp_path):
    path = tmp_path / "bench.toml"
    path.write_text(bench_text("brevini-hpv41"), encoding="utf-8")
    before = read_bench(path)
    old = before.bench.channels["supply pressure"].calibration
    now = write_calibration(before, "supply pressure", NEW).bench.channels["supply pressure"]
    assert now.calibration == NEW and now.calibration_history == (old,)
    again = write_calibration(read_bench(path), "supply pressure", NEW.model_copy(update={"slope": 24.6}))
    assert again.bench.channels["supply pressure"].calibration_history == (old, NEW)
    lines, kept = bench_text("brevini-hpv41").splitlines(), path.read_text(encoding="utf-8")
    assert [line for line in lines if "#" in line and line not in kept.splitlines()] == []
    others = {name: c for name, c in again.bench.channels.items() if name != "supply pressure"}
    assert others == {name: c for name, c in before.bench.channels.items() if name != "supply pressure"}
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_on_another_one_says_it_itself(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('based_on = "brevini-hpv41"\nname = "mine"  # ours\n', encoding="utf-8")
    now = write_calibration(read_bench(path), "flow", NEW)
    assert now.bench.channels["flow"].calibration == NEW.model_copy(update={"lag_s": 0.008})
    assert len(now.bench.channels["flow"].calibration_history) == 1
    said = tomllib.loads(path.read_text(encoding="utf-8"))
    assert set(said["channels"]["flow"]) == {"calibration", "calibration_history"} and "# ours" in path.read_text()


def test_limits_that_the_terminal_does_not_reach_are_narrowed(tmp_path):
    path = tmp_path / "bench.toml"
    path.write_text(bench_text("brevini-hpv41"), encoding="utf-8")
    now = write_calibration(read_bench(path), "command", NEW.model_copy(update={"slope": 9.9, "offset": 0.5}))
    limits = now.bench.channels["command"].limits
    assert limits is not None and (limits.low, limits.high) == (-98.5, 99.5)


def test_a_calibration_that_makes_faults_is_not_written(tmp_path):
    path = tmp_path / "bench.toml"
    path.write_text(bench_text("brevini-hpv41"), encoding="utf-8")
    file = read_bench(path)
    with pytest.raises(FileError, match=r"nothing was written: bench.toml:\d+: channels.command.safe"):
        write_calibration(file, "command", NEW.model_copy(update={"slope": 5.0, "offset": 60.0}))
    assert path.read_text(encoding="utf-8") == bench_text("brevini-hpv41") and list(tmp_path.iterdir()) == [path]
    path.write_text(bench_text("brevini-hpv41") + "\n# changed meanwhile\n", encoding="utf-8")
    with pytest.raises(FileError, match="has changed"):
        write_calibration(file, "command", NEW)
