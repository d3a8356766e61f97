"""`hil convert`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hil.record.folder import RunWriter
from hil.record.read import read_recording, write_recording
from hil.record.recording import recording


@pytest.fixture
def csv(tmp_path):
    time_s = np.arange(50) / 1000.0
    write_recording(recording("made", time_s, {"u [1]": time_s, "flow [l/min]": -time_s}), tmp_path / "made.csv")
    return tmp_path / "made.csv"


def test_there_and_back_through_a_run_folder(csv, tmp_path, command_line):
    there = command_line("convert", csv, tmp_path / "run")
    assert there.status == 0, there.err
    assert "50 samples, 0.049 s, u [1], flow [l/min]" in there.out
    back = command_line("convert", tmp_path / "run", tmp_path / "back.csv")
    assert back.status == 0, back.err
    assert (tmp_path / "back.csv").read_text() == csv.read_text()


def test_a_unit_can_be_stated(csv, tmp_path, prints):
    prints("convert", csv, tmp_path / "x.h5", "--unit", "u=%")
    found = read_recording(tmp_path / "x.h5")
    assert found.channels["u"].unit == "%"
    assert np.array_equal(found.values("u"), read_recording(csv).values("u"))


def test_what_was_assumed_is_said(tmp_path, command_line):
    from scipy.io import savemat

    savemat(tmp_path / "x.mat", {"Ts": 0.01, "y": np.arange(5.0)})
    done = command_line("convert", tmp_path / "x.mat", tmp_path / "x.csv")
    assert "note: even time base from Ts = 0.01" in done.out
    assert "note: no unit is stated for 'y'; taken as 1" in done.out
    stated = command_line("convert", tmp_path / "x.mat", tmp_path / "y.csv", "--unit", "y=bar")
    assert "taken as 1" not in stated.out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("made.csv", "made.csv"), "made.csv: exists already; --overwrite replaces it"),
        (("no.csv", "x.h5"), "no.csv: no such file or folder"),
        (("made.csv", "x.docx"), "x.docx: unknown kind of recording"),
        (("made.csv", "x.h5", "--unit", "flow"), "--unit flow: NAME=VALUE was expected, as in 'flow=l/min'"),
        (("made.csv", "x.h5", "--unit", "p=bar"), "--unit p: no channel 'p'; it has: time [s], u [1], flow [l/min]"),
        (("made.csv", "x.h5", "--unit", "u=furlong per"), "--unit 'u=furlong per': unknown unit 'furlong per'"),
    ],
)
def test_bad_input_is_one_line_and_status_2(csv, tmp_path, arguments, message, refused):
    assert message in refused("convert", *(tmp_path / part if "." in part else part for part in arguments))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["made.csv"]


def test_a_run_folder_is_never_replaced(csv, tmp_path, refused):
    with RunWriter.create(tmp_path / "run", {}, [("flow", "l/min")]) as run:
        run.append(np.arange(3.0), {"flow": np.arange(3.0)})
    done = refused("convert", csv, tmp_path / "run", "--overwrite")
    assert "a run is never written over another" in done
    assert len(read_recording(tmp_path / "run")) == 3


def of_one_channel(path: Path, times: list[str], values: list[float]) -> Path:
    rows = (f"{time};{value}" for time, value in zip(times, values, strict=True))
    path.write_text("\n".join(["Time;value", *rows]), encoding="utf-8")
    return path


def test_files_of_one_channel_each_are_joined_by_their_dates(tmp_path, prints):
    seconds = np.arange(0.0, 4.0, 0.5)
    early, late = (
        of_one_channel(tmp_path / f"{name}.csv", [f"2026-11-28 10:00:{t + s:04.1f}" for t in seconds], [*(seconds + s)])
        for name, s in (("u", 0.0), ("y", 1.5))
    )
    done = prints("convert", early, late, tmp_path / "both.csv")
    assert "y.csv: time counts from 2026-11-28T10:00:01.500" in done
    both = read_recording(tmp_path / "both.csv")
    assert both.values("u").tolist() == both.values("y").tolist() == [1.5, 2.0, 2.5, 3.0, 3.5]


def test_a_date_and_a_clock_of_a_device_are_not_joined(tmp_path, csv, refused):
    dated = of_one_channel(tmp_path / "u.csv", [f"2026-11-28 10:00:0{i}" for i in range(9)], [*range(9)])
    assert "its time is no date" in refused("convert", csv, dated, tmp_path / "both.csv")
