"""The archive: folders are the truth, the index finds them; on SQLite and on a real PostgreSQL."""

import json
import os
import resource
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from threading import Thread

import numpy as np
import pytest

from hil.archive.archive import Search, enter, find_runs, rebuild
from hil.archive.begun import begun_in, forget_begun, mark_begun
from hil.archive.pending import catch_up, enter_or_keep, keep_waiting, waiting_for
from hil.archive.place import INDEX_FILE, archive_place
from hil.archive.trend import drift_of, points_of
from hil.cli.run_end import entered
from hil.errors import ArchiveError
from hil.record.measurement import Findings, Measurement
from hil.record.run_folder.seal import seal_folder
from hil.record.state import state_path
from tests.kept_runs import kept_run
from tests.postgres import new_database
from tests.waits import until

GAIN = Measurement("gain", "l/min per %", "amplitude ratio", low=0.8)
FIRST = datetime(2026, 1, 1, tzinfo=UTC)


def made_run(folder, serial="A7", procedure="frequency_response", day=0, gain=0.9):
    """A run folder with results, as `hil run` leaves it."""
    started = (FIRST + timedelta(days=day)).isoformat()
    told = {"procedure": procedure, "bench": "bench one", "operator": "mk", "started_utc": started}
    return kept_run(folder, [GAIN.of(gain, 0.01)], serial, **told)


def names(place, **asked):
    """Of the runs that are found, in their order."""
    return [run.folder.name for run in find_runs(place, Search(**asked))]


@pytest.fixture
def folder_with_a_run(tmp_path):
    """An archive in a folder with one run, and the database of its index as another program opens it."""
    place = archive_place(str(tmp_path / "lab"))
    enter(place, [made_run(place.folder / "a")])
    with closing(sqlite3.connect(place.folder / INDEX_FILE)) as other:
        yield place, other


def test_runs_are_found_by_what_was_asked(place, tmp_path):
    made = [made_run(tmp_path / "lab" / "a"), made_run(tmp_path / "lab" / "b", serial="B2", day=1, gain=0.7)]
    for entered_twice in (made, made[:1]):
        enter(place, entered_twice)
    assert [run.folder for run in find_runs(place, Search())] == made
    assert names(place, serial="B2") == ["b"]
    assert names(place, verdict="pass") == ["a"]
    assert names(place, since=FIRST + timedelta(hours=1)) == ["b"]
    assert find_runs(place, Search(procedure="flow_curve")) == []
    (found,) = find_runs(place, Search(serial="A7"), values=True)
    assert (found.operator, found.started_utc, found.values[0].value) == ("mk", FIRST, 0.9)


def test_index_is_made_anew_from_folders_that_were_moved(place, tmp_path):
    enter(place, [made_run(tmp_path / "lab" / "a")])
    shutil.move(tmp_path / "lab" / "a", tmp_path / "lab" / "deep" / "er")
    (tmp_path / "lab" / "broken").mkdir()
    (tmp_path / "lab" / "broken" / "run.json").write_text("{", encoding="utf-8")
    count, left_out = rebuild(place, [tmp_path / "lab"])
    assert count == 1
    assert "broken" in left_out[0]
    assert names(place) == ["er"]


def test_two_benches_write_at_once(place, tmp_path):
    benches = [[made_run(tmp_path / "lab" / f"{bench}{i}") for i in range(8)] for bench in "ab"]
    find_runs(place, Search())

    def work(folders):
        for folder in folders:
            enter(place, [folder])

    threads = [Thread(target=work, args=(folders,)) for folders in benches]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(names(place)) == 16


@pytest.mark.parametrize("names", [("runs/a", "runs-a", "Runs a"), ("deep/" * 60 + "runs",)], ids=["alike", "long"])
def test_runs_wait_for_their_own_archive_whatever_its_name(tmp_path, names):
    places = [archive_place(str(tmp_path / name)) for name in names]
    for number, place in enumerate(places):
        place.folder.mkdir(parents=True)
        (place.folder / INDEX_FILE).mkdir()
        assert "entered later" in enter_or_keep(place, made_run(tmp_path / f"run{number}"))
    assert [[path.name for path in waiting_for(place)] for place in places] == [[f"run{n}"] for n in range(len(names))]
    before = state_path("archive", str(places[0]), ".json")
    if len(names) > 1:  # an earlier version kept a list under the name
        before.write_text(json.dumps([str(made_run(tmp_path / "earlier"))]))
    (places[0].folder / INDEX_FILE).rmdir()
    catch_up(places[0])
    found = {run.folder.name for run in find_runs(places[0], Search())}
    assert found == ({"run0", "earlier"} if len(names) > 1 else {"run0"})
    assert waiting_for(places[0]) == []


def test_locked_index_keeps_the_run_and_enters_it_later(folder_with_a_run, tmp_path):
    place, other = folder_with_a_run
    other.execute("BEGIN EXCLUSIVE")
    said = enter_or_keep(place, made_run(tmp_path / "lab" / "b"))
    other.rollback()
    assert "locked" in said
    assert "will be entered later" in said
    assert [path.name for path in waiting_for(place)] == ["b"]
    catch_up(place)
    assert waiting_for(place) == []
    assert sorted(names(place)) == ["a", "b"]


@pytest.mark.parametrize(
    ("url", "cause"),
    [
        ("postgresql://hil@127.0.0.1:9/none", "refused"),
        ("sqlite:////nowhere/at/all.sqlite", "unable to open"),
        ("oracle://host/none", ""),
    ],
)
def test_database_that_is_away_never_fails_a_run(tmp_path, url, cause):
    place = archive_place(url)
    said = enter_or_keep(place, made_run(tmp_path / "a"))
    assert cause in said
    assert str(tmp_path / "a") in said


def test_damaged_index_is_made_anew(folder_with_a_run):
    place, _ = folder_with_a_run
    (place.folder / INDEX_FILE).write_bytes(b"no database at all" * 100)
    with pytest.raises(ArchiveError):
        names(place)
    assert rebuild(place, [place.folder]) == (1, [])
    assert names(place) == ["a"]


@pytest.mark.skipif(sys.platform != "linux", reason="limits how far a file may grow")
def test_an_index_that_a_full_disk_broke_off_is_made_when_there_is_room(tmp_path):
    place, run = archive_place(str(tmp_path / "lab")), made_run(tmp_path / "lab" / "a")
    was = resource.getrlimit(resource.RLIMIT_FSIZE)
    for most in range(8192, 65536, 4096):  # breaks off at one step of its making after the other
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, was[1]))
        try:
            said = enter_or_keep(place, run)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, was)
        assert not said or "entered later" in said
    catch_up(place)
    assert names(place) == ["a"]


def test_a_half_made_index_is_made_anew(folder_with_a_run):
    place, other = folder_with_a_run
    other.execute("delete from alembic_version")
    other.commit()
    with pytest.raises(ArchiveError, match="half made"):
        names(place)
    assert rebuild(place, [place.folder]) == (1, [])
    assert names(place) == ["a"]


@pytest.mark.parametrize("later", [(), ("c", "d")], ids=["when it is asked", "by a run that finds none"])
def test_a_missing_index_is_made_anew(tmp_path, later):
    place = archive_place(str(tmp_path / "lab"))
    for name in ("a", "b"):
        made_run(tmp_path / "lab" / name)
    for name in later:
        assert enter_or_keep(place, made_run(tmp_path / "lab" / name)) == ""
    catch_up(place)
    assert sorted(names(place)) == ["a", "b", *later]
    assert waiting_for(place) == []


def test_a_folder_that_cannot_be_listed_hides_no_run_beside_it(tmp_path, monkeypatch):
    made_run(tmp_path / "lab" / "deep" / "a")
    shut, listed = tmp_path / "lab" / "deep" / "of somebody else", Path.iterdir
    shut.mkdir()

    def iterdir(path):
        if path == shut:
            raise PermissionError(13, "Permission denied", str(path))
        return listed(path)

    monkeypatch.setattr(Path, "iterdir", iterdir)  # the tests may run as root, whom nothing is denied
    place = archive_place(str(tmp_path / "lab"))
    count, (left_out,) = rebuild(place, [tmp_path / "lab"])
    assert count == 1 and str(shut) in left_out
    assert names(place) == ["a"]


def test_asking_an_archive_that_is_not_there_makes_none(tmp_path):
    place = archive_place(str(tmp_path / "typo"))
    catch_up(place)
    assert find_runs(place, Search()) == []
    with pytest.raises(ArchiveError, match="no such folder"):
        rebuild(place, [tmp_path / "typo"])
    assert not (tmp_path / "typo").exists()


def test_run_of_the_first_version_is_entered_with_its_findings(tmp_path):
    folder = made_run(tmp_path / "lab" / "a")
    (folder / "results.json").unlink()
    found = Findings((GAIN.of(0.7, 0.01),))
    findings = {"verdict": found.verdict, "measured": [one.as_dict() for one in found.measured]}
    (folder / "findings.json").write_text(json.dumps(findings), encoding="utf-8")
    place = archive_place(str(tmp_path / "lab"))
    enter(place, [folder])
    (found,) = find_runs(place, Search(verdict="fail"), values=True)
    assert found.values[0].value == 0.7


@pytest.mark.parametrize(("name", "before", "after"), [("run.json", '"A7"', '"B9"'), ("results.json", "0.9", "0.99")])
def test_a_run_that_somebody_edited_is_left_out_and_named(tmp_path, command_line, name, before, after, prints):
    folder = made_run(tmp_path / "lab" / "a")
    seal_folder(folder, {})
    edited = folder / name
    edited.write_text(edited.read_text(encoding="utf-8").replace(before, after), encoding="utf-8")
    said = command_line("archive", "rebuild", "--archive", str(tmp_path / "lab"))
    assert f"{edited}: changed after the run was" in said.err
    assert "A7" not in prints("runs", "--archive", str(tmp_path / "lab"))


def test_place_is_the_option_then_the_environment_then_runs(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("HIL_ARCHIVE", raising=False)
    assert archive_place().folder == tmp_path / "runs"
    monkeypatch.setenv("HIL_ARCHIVE", str(tmp_path / "lab"))
    assert archive_place().folder == tmp_path / "lab"
    assert archive_place("postgresql://hil:secret@lab/x").folder is None
    assert "secret" not in str(archive_place("postgresql://hil:secret@lab/x"))


def test_columns_of_the_tables_are_those_of_the_migrations(tmp_path):
    from sqlalchemy import inspect

    from hil.archive.database import opened
    from hil.archive.tables import TABLES

    with opened(archive_place(str(tmp_path))) as engine:
        found = inspect(engine)
        for table in TABLES.sorted_tables:
            assert {column["name"] for column in found.get_columns(table.name)} == set(table.columns.keys())
        indexed = {index["name"].removeprefix("run_by_") for index in found.get_indexes("run")}
        assert indexed >= {"start", "serial", "procedure", "verdict"}


# -- trends ------------------------------------------------------------------------------------------------


def _points(tmp_path, values):
    place = archive_place(str(tmp_path / "lab"))
    enter(place, [made_run(tmp_path / "lab" / str(day), day=day, gain=value) for day, value in enumerate(values)])
    return points_of(find_runs(place, Search(), values=True), "gain")


def test_drift_is_found_with_its_slope(tmp_path):
    points = _points(tmp_path, 0.9 + 0.01 * np.arange(8.0))
    drift = drift_of(points)
    assert drift.is_drift
    assert drift.per_year == pytest.approx(3.6525, rel=1e-6)
    assert drift.sentence.startswith("It drifts: +3.65 ± 1.1 l/min per % per year")


def test_false_alarms_of_the_drift_test_come_at_the_stated_rate(tmp_path):
    points = _points(tmp_path, [0.9] * 8)
    rng = np.random.default_rng(5)
    alarms = 0
    for _ in range(2000):
        noisy = [
            type(p)(p.run, p.started_utc, replace(p.value, value=0.9 + 0.01 * rng.standard_normal())) for p in points
        ]
        alarms += drift_of(noisy).is_drift
    assert alarms <= 30  # 1 % of 2000 and three standard deviations, as the scale is never below the stated one


def test_two_values_tell_no_drift(tmp_path):
    assert "No drift can be determined" in drift_of(_points(tmp_path, [0.9, 1.9])).sentence


# -- at the prompt -----------------------------------------------------------------------------------------


def test_commands_list_follow_and_rebuild(tmp_path, command_line, refused):
    lab = tmp_path / "lab"
    for day in range(4):
        made_run(lab / str(day), day=day)
    said = command_line("archive", "rebuild", "--archive", lab)
    assert (said.status, said.out.strip()) == (0, f"{lab}: 4 runs")
    said = command_line("runs", "--serial", "A7", "--archive", lab, "--json")
    rows = json.loads(said.out)
    assert [Path(row["run"]).name for row in rows] == ["0", "1", "2", "3"]
    assert set(rows[0]) == {"run", "serial", "operator", "procedure", "started_utc", "verdict", "simulated"}
    said = command_line("trend", "gain", "--serial", "A7", "--archive", lab, "--json")
    assert len(json.loads(said.out)["values"][0]["points"]) == 4
    said = refused("trend", "gian", "--serial", "A7", "--archive", lab)
    assert "did you mean 'gain'" in said
    said = refused("runs", "--since", "yesterday", "--archive", lab)
    assert "2026-11-25" in said


@pytest.mark.parametrize(
    ("outcome", "word"),
    [
        ("TrippedError: interlock 'too-much-flow': 35.8 for 0.05 s; outputs are safe (read back)", "tripped"),
        ("KeyboardInterrupt: outputs are safe (read back)", "stopped"),
        ("Terminated: SIGTERM", "stopped"),
        ("Halted: stop was pressed", "stopped"),
        ("LinkError: io: no answer", "failed"),
    ],
)
def test_how_a_run_ended_is_listed_in_a_word(tmp_path, outcome, word, command_line):
    folder = made_run(tmp_path / "lab" / "a")
    end = json.loads((folder / "end.json").read_text(encoding="utf-8"))
    end["outcome"] = outcome
    (folder / "end.json").write_text(json.dumps(end), encoding="utf-8")
    said = command_line("runs", "--archive", tmp_path / "lab")
    assert f"pass ({word})  mk" in said.out


def test_a_value_is_asked_for_by_name_without_the_numbers_of_its_place():
    from hil.record.measurement import Findings, Limit, Measurement, names_of

    assert names_of("gain, high, 133…147 psi") == ("gain, high, 133…147 psi", "gain, high", "gain")
    gain = Measurement("gain", "psi per A", "gain")
    found = Findings((gain.at("high, 133…147 psi").of(4.0, 0.1), gain.at("low, 19…21 psi").of(4.0, 0.1)))
    assert [m.verdict for m in found.judged({"gain, high": Limit(low=5.0)}).measured] == ["fail", None]


def test_times_are_shown_where_the_reader_is(monkeypatch):
    import time
    from datetime import UTC, datetime

    from hil.report.local_time import local_text

    with monkeypatch.context() as patch:
        patch.setenv("TZ", "Asia/Kolkata")
        time.tzset()
        assert local_text(datetime(2026, 11, 24, 22, 0, tzinfo=UTC)) == "2026-11-25 03:30:00 +05:30"
    time.tzset()


def test_a_table_that_somebody_locks_keeps_the_run_and_enters_it_later(postgresql, tmp_path):
    import time

    import psycopg

    url = new_database(postgresql)
    place = archive_place(url)
    enter(place, [made_run(tmp_path / "a")])
    with psycopg.connect(url) as other:
        other.execute("LOCK TABLE run IN ACCESS EXCLUSIVE MODE")
        began = time.monotonic()
        said = enter_or_keep(place, made_run(tmp_path / "b"))
        took_s = time.monotonic() - began
        other.rollback()
    assert "lock timeout" in said
    assert took_s < 600.0, "the bench waited"
    catch_up(place)
    assert sorted(names(place)) == ["a", "b"]


def _dead_pid():
    gone = subprocess.Popen(["true"])
    gone.wait()
    return gone.pid


def test_a_run_that_was_killed_is_found_by_the_next_search(place, monkeypatch, own_state, tmp_path):
    enter(place, [made_run(tmp_path / "lab" / "before")])
    folder = made_run(tmp_path / "lab" / "killed")
    mark_begun(place, folder)
    (folder / "end.json").unlink()
    catch_up(place)
    assert [run.outcome for run in find_runs(place, Search())] == ["completed", "not closed"]
    assert [begun.is_over for begun in begun_in(place)] == [False]  # its process is this one
    with monkeypatch.context() as other:
        other.setattr("os.getpid", _dead_pid)
        mark_begun(place, folder)
    catch_up(place)
    assert list(begun_in(place)) == []
    assert len(names(place)) == 2


def test_a_run_that_never_recorded_leaves_no_mark(own_state, tmp_path):
    place = archive_place(str(tmp_path / "lab"))
    mark_begun(place, tmp_path / "lab" / "refused")
    forget_begun(tmp_path / "lab" / "refused")
    assert list(begun_in(place)) == []


def test_killed_and_running_are_told_apart_in_the_list(tmp_path, command_line):
    for name, pid in (("killed", _dead_pid()), ("running", os.getpid())):
        folder = made_run(tmp_path / "lab" / name)
        (folder / "end.json").unlink()
        (folder / "progress.json").write_text(json.dumps({"share": 0.4, "text": "2 Hz", "pid": pid}), encoding="utf-8")
    said = command_line("runs", "--archive", tmp_path / "lab")
    assert [line.split("(")[1].split(")")[0] for line in said.out.splitlines()[1:]] == ["lost", "running"]


def test_a_waiting_run_whose_header_is_torn_keeps_no_other_out(place, own_state, tmp_path):
    enter(place, [made_run(tmp_path / "lab" / "before")])
    lab = tmp_path / "lab"
    torn, sound, last = (made_run(lab / name, day=i) for i, name in enumerate(("torn", "sound", "last")))
    (torn / "run.json").write_text("{", encoding="utf-8")
    keep_waiting(place, [torn, sound])
    (said,) = catch_up(place)
    assert "torn" in said and names(place) == ["before", "sound"]
    assert catch_up(place) == []
    keep_waiting(place, [torn])
    assert "torn" in enter_or_keep(place, last) and waiting_for(place) == []
    assert names(place) == ["before", "sound", "last"]


def test_a_run_that_is_entered_slowly_says_so(tmp_path, monkeypatch, capfd):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "run.json").write_text("{}")
    said: list[str] = []

    def slowly(*_):
        until(lambda: said.append(capfd.readouterr().err) or "being entered" in "".join(said))
        return ""

    monkeypatch.setattr("hil.archive.pending.enter_or_keep", slowly)
    entered(str(tmp_path), tmp_path / "run")
    assert "100%  the run is over and its folder is closed; it is being entered into the archive" in "".join(said)


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo terminals")
def test_a_run_whose_terminal_is_stopped_ends_without_its_archive(tmp_path):
    (tmp_path / "run").mkdir()
    for name in ("run/run.json", "no folder"):
        (tmp_path / name).write_text("{}")
    near, far = os.openpty()
    os.write(near, b"\x13")  # Ctrl-S
    code = (
        "import sys; from pathlib import Path; from hil.cli.run_end import entered; entered(*map(Path, sys.argv[1:]))"
    )
    words = [sys.executable, "-P", "-c", code, str(tmp_path / "no folder" / "archive"), str(tmp_path / "run")]
    ended = subprocess.run(words, stdin=far, stdout=far, stderr=far, timeout=290.0, check=False)
    assert ended.returncode == 0
    os.write(near, b"\x11")
    os.close(far)
    os.close(near)
