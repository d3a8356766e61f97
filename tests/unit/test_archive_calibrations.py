"""The calibrations of a bench in the archive, against what its runs say of themselves."""

import datetime as dt
import json
import sqlite3

import numpy as np

from hil.archive.archive import Search, enter, find_runs, rebuild
from hil.archive.calibrations import instruments
from hil.archive.place import INDEX_FILE, archive_place
from hil.record.folder import write
from hil.record.recording import Channel, Recording

FIRST = dt.datetime(2026, 1, 1, 23, 59, tzinfo=dt.UTC)


def made(folder, day=0, due="2026-02-01", date="2025-02-01", bench="one", meters=()):
    """A run with a calibrated channel, and instruments."""
    line = {"slope": 2.0, "uncertainty": 0.5, "date": date, "due": due, "source": "certificate 12"} if date else {}
    channels = {"flow": Channel("flow", "l/min", np.zeros(3), "gear meter", line)}
    meta = {"bench": bench, "procedure": "step", "instruments": list(meters), "outcome": "completed",
            "started_utc": (FIRST + dt.timedelta(days=day)).isoformat()}  # fmt: skip
    write(Recording(str(folder), np.arange(3.0), channels, meta), folder)
    return folder


def test_calibrations_are_those_of_the_header(place, tmp_path):
    meter = {
        "name": "flow meter",
        "serial": "4711",
        "channel": "flow",
        "calibrated": "2025-03-01",
        "uncertainty": "1 %",
    }
    enter(place, [made(tmp_path / "lab" / "a", meters=[meter])])
    (meter_found, line), unread = instruments(place)
    assert unread == 0
    stated = line.calibration
    assert (stated.channel, stated.instrument, stated.reference) == ("flow", "gear meter", "certificate 12")
    assert (stated.date, stated.due) == (dt.date(2025, 2, 1), dt.date(2026, 2, 1))
    assert stated.uncertainty == "0.5 l/min"
    assert stated.days_left(dt.date(2026, 2, 3)) == -2
    assert (meter_found.calibration.serial, meter_found.calibration.due) == ("4711", None)
    assert meter_found.calibration.days_left(dt.date(2026, 2, 3)) is None


def test_runs_after_the_due_day_are_named_and_those_on_it_are_not(place, tmp_path):
    for day in (30, 31, 32, 40):  # 31 January, 1 February (one minute before midnight), …
        enter(place, [made(tmp_path / "lab" / str(day), day)])
    enter(place, [made(tmp_path / "lab" / "new", 41, date="2026-02-11", due="2027-02-11")])
    ((one,), _) = instruments(place)
    assert [run.run.name for run in one.overdue] == ["32", "40"]
    assert {run.due for run in one.overdue} == {dt.date(2026, 2, 1)}
    assert (one.calibration.due, one.runs, one.in_use) == (dt.date(2027, 2, 11), 5, True)


def test_instrument_that_its_bench_no_longer_states_is_out_of_use(place, tmp_path):
    old = {"name": "old meter", "due": "2026-01-10"}
    enter(place, [made(tmp_path / "lab" / "a", meters=[old]), made(tmp_path / "lab" / "b", 5)])
    enter(place, [made(tmp_path / "lab" / "c", bench="two", meters=[old])])
    found, _ = instruments(place)
    assert {(one.bench, one.calibration.instrument): one.in_use for one in found} == {
        ("one", "old meter"): False, ("one", "gear meter"): True,
        ("two", "old meter"): True, ("two", "gear meter"): True,
    }  # fmt: skip


def test_rebuild_makes_them_anew(place, tmp_path):
    enter(place, [made(tmp_path / "lab" / str(day), day) for day in (0, 60)])
    before = instruments(place)
    assert rebuild(place, [tmp_path / "lab"]) == (2, [])
    assert instruments(place) == before
    enter(place, [tmp_path / "lab" / "60"])
    assert instruments(place) == before


def test_what_is_no_date_is_not_stated(tmp_path):
    place = archive_place(str(tmp_path / "lab"))
    enter(place, [made(tmp_path / "lab" / "a", date="spring", due="soon")])
    ((one,), _) = instruments(place)
    assert (one.calibration.date, one.calibration.due, one.overdue) == (None, None, ())


def test_index_of_the_version_before_is_brought_up_and_says_what_it_lacks(tmp_path, command_line, prints):
    lab = tmp_path / "lab"
    enter(archive_place(str(lab)), [made(lab / "a")])
    with sqlite3.connect(lab / INDEX_FILE) as other:
        other.execute("DROP TABLE calibration")
        other.execute("ALTER TABLE run DROP COLUMN instruments")
        other.execute("ALTER TABLE run DROP COLUMN host")
        other.execute("ALTER TABLE run DROP COLUMN simulated")
        other.execute("UPDATE alembic_version SET version_num = '0001'")
    other.close()
    assert [run.folder.name for run in find_runs(archive_place(str(lab)), Search())] == ["a"]
    text = prints("archive", "calibrations", "--archive", lab)
    assert "1 runs were entered without their calibrations: `hil archive rebuild`" in text
    command_line("archive", "rebuild", "--archive", lab)
    text = prints("archive", "calibrations", "--archive", lab)
    assert "gear meter" in text
    assert "without their calibrations" not in text


def test_command_lists_what_falls_due(tmp_path, command_line, prints):
    lab, today = tmp_path / "lab", dt.datetime.now(dt.UTC).date()
    soon = {"name": "soon", "due": str(today + dt.timedelta(days=20))}
    later = {"name": "later", "due": str(today + dt.timedelta(days=21))}
    enter(archive_place(str(lab)), [made(lab / "a", meters=[soon, later, {"name": "never"}])])
    ask = ("archive", "calibrations", "--archive", lab, "--due-within", "20")
    status, text, _ = command_line(*ask, "--json")
    told = json.loads(text)
    assert status == 0
    assert told["schema"] == "hil.calibrations/1"
    assert {row["instrument"]: row["days_left"] for row in told["calibrations"]} == {
        "gear meter": (dt.date(2026, 2, 1) - today).days, "soon": 20
    }  # fmt: skip
    assert told["without_due_date"] == 1
    text = prints(*ask)
    assert "later" not in text
    assert "1 of the instruments in use state no due date" in text
