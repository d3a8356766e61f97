"""A database that benches share: each keeps to its own runs, one bad run holds no other, no password is shown."""

from __future__ import annotations

import hashlib
import json
import os
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hil.archive.archive import Search, enter, find_runs, rebuild
from hil.archive.begun import begun_in, mark_begun
from hil.archive.pending import catch_up, enter_or_keep, waiting_for
from hil.archive.place import INDEX_FILE, Place, archive_place
from hil.child import python
from hil.console.process import start
from hil.errors import ArchiveError
from hil.record.state import state_path
from tests.postgres import new_database
from tests.unit import test_archive
from tests.unit.test_archive import made_run, names

pytestmark = pytest.mark.usefixtures("unprinted")

SECRET = "gehe1m"
folder_with_a_run = test_archive.folder_with_a_run  # a fixture


@pytest.fixture
def lab(postgresql):
    """A database that benches share."""
    return archive_place(new_database(postgresql))


@pytest.fixture
def bench(monkeypatch):
    """Be another computer."""
    return lambda name: monkeypatch.setattr("socket.gethostname", lambda: name)


# -- each bench keeps to its own runs ---------------------------------------------------------------------


@pytest.mark.parametrize("hidden", [True, False], ids=["folders of its own", "the same path on both"])
def test_rebuild_on_one_bench_leaves_the_runs_of_the_others(lab, bench, tmp_path, hidden):
    bench("bench-b")
    there = tmp_path / ("b" if hidden else "a")
    enter(lab, [made_run(there / "b1", serial="B1"), made_run(there / "b2", serial="B2", day=1)])
    there.rename(tmp_path / "on-another-computer")
    bench("bench-a")
    enter(lab, [made_run(tmp_path / "a" / "a1"), made_run(tmp_path / "a" / "a2", day=2)])
    (tmp_path / "a" / "a2").rename(tmp_path / "gone")
    assert rebuild(lab, [tmp_path / "a"]) == (1, [])
    assert sorted(names(lab)) == ["a1", "b1", "b2"]
    assert rebuild(lab, []) == (1, [])  # where its own runs lay
    assert sorted(names(lab)) == ["a1", "b1", "b2"]


def test_the_same_path_on_two_benches_is_two_runs(lab, bench, tmp_path):
    for day, host in enumerate(("bench-a", "bench-b")):
        bench(host)
        enter(lab, [made_run(tmp_path / "runs" / "one", serial=host, day=day)])
        (tmp_path / "runs" / "one").rename(tmp_path / host)
    assert [(run.host, run.serial) for run in find_runs(lab, Search())] == [(h, h) for h in ("bench-a", "bench-b")]


def test_a_folder_that_two_benches_share_is_one_run(lab, bench, tmp_path):
    shared = made_run(tmp_path / "nas")
    for host in ("bench-a", "bench-b", "bench-a"):
        bench(host)
        enter(lab, [shared])
    assert [run.host for run in find_runs(lab, Search())] == ["bench-a"]


def test_what_lies_outside_the_searched_folders_stays(place, tmp_path):
    enter(place, [made_run(tmp_path / "lab" / "a"), made_run(tmp_path / "disk" / "b", serial="B2")])
    (tmp_path / "disk").rename(tmp_path / "unplugged")
    assert rebuild(place, [tmp_path / "lab"]) == (1, [])
    assert sorted(names(place)) == ["a", "b"]
    assert rebuild(place, [tmp_path / "lab", tmp_path / "unplugged"]) == (2, [])  # the same run, found elsewhere
    assert [run.folder for run in find_runs(place, Search(serial="B2"))] == [tmp_path / "unplugged" / "b"]


def test_a_folder_of_another_bench_is_named_with_it_and_not_missed(lab, bench, tmp_path, command_line):
    bench("bench-b")
    enter(lab, [made_run(tmp_path / "b1")])
    (tmp_path / "b1").rename(tmp_path / "away")
    bench("bench-a")
    said = command_line("runs", "--archive", lab.url)
    assert said.status == 0 and f"bench-b:{tmp_path / 'b1'}" in said.out and "not there any more" not in said.err


def test_an_index_of_the_version_before_is_taken_over(postgresql, bench, tmp_path):
    import psycopg

    place = archive_place(new_database(postgresql))
    enter(place, [made_run(tmp_path / "a" / "a1"), made_run(tmp_path / "b" / "b1", serial="B2")])
    with psycopg.connect(place.url.replace("+psycopg", ""), autocommit=True) as database:
        database.execute("ALTER TABLE run DROP CONSTRAINT run_by_place")
        database.execute("ALTER TABLE run DROP COLUMN host, DROP COLUMN simulated")
        database.execute("ALTER TABLE run ADD CONSTRAINT run_folder_key UNIQUE (folder)")
        database.execute("UPDATE alembic_version SET version_num = '0002'")
    (tmp_path / "b").rename(tmp_path / "on-another-computer")
    assert [run.host for run in find_runs(place, Search())] == [None, None]
    assert rebuild(place, [tmp_path / "a"]) == (1, [])
    assert {run.folder.name: run.host is None for run in find_runs(place, Search())} == {"a1": False, "b1": True}


# -- one run that is refused ------------------------------------------------------------------------------


BAD = {"too long": "x" * 270, "no character": "bench\x00one"}


def run_with(folder: Path, **meta: str) -> Path:
    """A run whose header was written, and sealed, with these words."""
    header, end = made_run(folder) / "run.json", folder / "end.json"
    content, sealed = json.loads(header.read_text()), json.loads(end.read_text())
    header.write_text(json.dumps(content | {"meta": content["meta"] | meta}))
    sealed["sha256"]["run.json"] = hashlib.sha256(header.read_bytes()).hexdigest()
    end.write_text(json.dumps(sealed))
    return folder


def refused_run(folder: Path, how: str) -> Path:
    """A run whose bench has a name that PostgreSQL does not take."""
    return run_with(folder, bench=BAD[how])


@pytest.mark.parametrize("how", BAD)
def test_a_run_that_the_database_refuses_is_told_and_holds_no_other(lab, tmp_path, how):
    bad, good = refused_run(tmp_path / "bad", how), made_run(tmp_path / "good")
    said = enter_or_keep(lab, bad)
    assert "not in the archive" in said and str(bad) in said and "refuses it" in said
    assert waiting_for(lab) == []
    assert enter_or_keep(lab, good) == "" and sorted(names(lab)) == ["good"]
    (left_out,) = enter(lab, [made_run(tmp_path / "before"), bad, made_run(tmp_path / "after")])
    assert str(bad) in left_out and sorted(names(lab)) == ["after", "before", "good"]
    count, left_out = rebuild(lab, [tmp_path])
    assert count == 3 and str(bad) in left_out[0] and sorted(names(lab)) == ["after", "before", "good"]


RULES = {
    "constraint": "ALTER TABLE run ADD CONSTRAINT lab CHECK (procedure <> 'wild')",
    "trigger": "CREATE FUNCTION lab() RETURNS trigger AS $$ BEGIN IF NEW.procedure = 'wild' THEN RAISE 'no'; END IF; "
    "RETURN NEW; END $$ LANGUAGE plpgsql; CREATE TRIGGER lab BEFORE INSERT ON run FOR EACH ROW EXECUTE FUNCTION lab()",
    "size": "CREATE INDEX lab ON run (operator)",
}  # fmt: skip


@pytest.mark.parametrize("rule", RULES)
def test_a_rule_of_the_lab_that_refuses_a_run_holds_no_other(lab, tmp_path, rule):
    import psycopg

    assert enter_or_keep(lab, made_run(tmp_path / "first")) == ""
    with psycopg.connect(lab.url.replace("+psycopg", ""), autocommit=True) as administrator:
        administrator.execute(RULES[rule])
    operator = "".join(chr(0x4E00 + 7919 * i % 20000) for i in range(4000))
    bad = run_with(tmp_path / "bad", procedure="wild", operator=operator)
    said = enter_or_keep(lab, bad)
    assert "not in the archive" in said and "refuses it" in said and len(said) < 500
    assert waiting_for(lab) == [] and enter_or_keep(lab, made_run(tmp_path / "good")) == ""
    assert sorted(names(lab)) == ["first", "good"]


def test_runs_that_waited_behind_a_refused_one_are_entered(lab, tmp_path, monkeypatch):
    away = archive_place(lab.url.replace(lab.url.rsplit(":", 1)[1].split("/")[0], "9"))
    for folder in (refused_run(tmp_path / "bad", "too long"), made_run(tmp_path / "good")):
        assert "entered later" in enter_or_keep(away, folder)
    lists = state_path("archive", "any", ".json").parent.glob("*.json")
    waiting = max(lists, key=lambda path: path.stat().st_mtime_ns)
    monkeypatch.setattr("hil.archive.pending.state_path", lambda *_: waiting)
    (said,) = catch_up(lab)
    assert "bad" in said and sorted(names(lab)) == ["good"] and waiting_for(lab) == []


@pytest.mark.parametrize("character", ["\udc80", "\x00"])
def test_a_name_that_is_no_text_is_refused_by_either_database_in_words(place, tmp_path, character):
    folder = run_with(tmp_path / "lab" / "a", operator=f"Eva{character}")
    said = enter_or_keep(place, folder)
    assert said == "" or "refuses it" in said or "JSON was expected" in said
    assert enter_or_keep(place, made_run(tmp_path / "lab" / "b")) == "" and "b" in names(place)


# -- what an index is removed for --------------------------------------------------------------------------


@pytest.fixture
def newer(folder_with_a_run):
    """An archive whose index a newer version of this program has made."""
    place, other = folder_with_a_run
    other.execute("UPDATE alembic_version SET version_num = '9999'")
    other.commit()
    return place


def test_an_index_of_a_newer_version_is_never_removed(newer):
    before = (newer.folder / INDEX_FILE).read_bytes()
    with pytest.raises(ArchiveError, match="newer version of this program and stays"):
        rebuild(newer, [newer.folder])
    assert (newer.folder / INDEX_FILE).read_bytes() == before


@pytest.mark.parametrize(
    "command",
    [("runs",), ("trend", "gain", "--serial", "A1"), ("archive", "calibrations"), ("compare", "--population")],
)
def test_why_an_archive_cannot_be_used_is_said_once_where_runs_wait(command, newer, tmp_path, refused):
    waits = made_run(tmp_path / "waits")
    assert "entered later" in enter_or_keep(newer, waits)
    said = refused(*command, *([waits] if command[0] == "compare" else []), "--archive", newer.folder)
    assert said.count("newer version of this program") == 1


def test_an_index_that_somebody_locks_is_never_removed(folder_with_a_run):
    place, other = folder_with_a_run
    other.execute("BEGIN EXCLUSIVE")
    with pytest.raises(ArchiveError, match="locked"):
        rebuild(place, [place.folder])
    other.rollback()
    assert names(place) == ["a"]


# -- the password ------------------------------------------------------------------------------------------


def secret_place(postgresql: str = "postgresql://hil@127.0.0.1:9/none") -> Place:
    return archive_place(postgresql.replace("://hil@", f"://hil:{SECRET}@"))


def test_a_mark_of_a_run_that_began_holds_no_password_and_is_its_owners(tmp_path, own_state):
    place = secret_place()
    mark_begun(place, made_run(tmp_path / "a"))
    (found,) = begun_in(place)
    assert SECRET not in found.mark.read_text() and stat.S_IMODE(found.mark.stat().st_mode) == 0o600
    enter_or_keep(place, tmp_path / "a")
    written = [path for path in (tmp_path / "state").rglob("*") if path.is_file()]
    assert written and not any(SECRET.encode() in path.read_bytes() for path in written)


@pytest.mark.parametrize(
    "url",
    [
        f"postgresql://hil:{SECRET}@127.0.0.1:9/none",
        f"postgresql://hil:{SECRET}@127.0.0.1:port/none",
        f"postgresql://hil:{SECRET}/x@127.0.0.1:9/none",
        f"postgresql://hil:p@{SECRET}@127.0.0.1:9/none",
        f"postgresql://hil:{SECRET}@[::1/none",
        f"nosuch://hil:{SECRET}@127.0.0.1/none",
        f"postgresql://hil:{SECRET}@127.0.0.1:9/none?no_such_option={SECRET}",
    ],
)
@pytest.mark.parametrize("command", [("runs",), ("archive", "rebuild"), ("trend", "gain", "--serial", "A7")])
def test_no_message_shows_a_password(url, command, tmp_path, monkeypatch, command_line):
    monkeypatch.setenv("HIL_ARCHIVE", url)
    status, out, err = command_line("--debug", *command)
    assert status == 2 and "archive" in out + err and SECRET not in out + err


def test_a_password_is_in_no_command_line_that_a_console_starts(tmp_path, monkeypatch):
    place = secret_place()
    slow = tmp_path / "hil.py"
    slow.write_text("import os, sys, time; print(os.environ['HIL_ARCHIVE'], flush=True); time.sleep(60)")
    monkeypatch.setattr("hil.child.python", lambda _module, *arguments: [sys.executable, str(slow), *arguments])
    made = start("run", ["run", "flow_curve"], tmp_path / "log", place=place)
    try:
        while not made.lines:
            time.sleep(0.01)
        assert SECRET not in Path(f"/proc/{made.process.pid}/cmdline").read_text()
        assert archive_place(made.last_line) == place
    finally:
        made.process.kill()
        made.process.wait()


def test_a_shown_place_has_no_password():
    place = secret_place()
    assert SECRET not in repr(place) and SECRET not in str(place) and SECRET in place.address


def test_a_run_of_the_command_line_tells_nobody_the_password(postgresql, tmp_path, monkeypatch):
    """A whole run with the address in the environment: neither its processes nor its files show the password."""
    environment = {**os.environ, "HIL_ARCHIVE": secret_place(new_database(postgresql)).url.replace("+psycopg", ""),
                   "HIL_STATE_DIR": str(tmp_path / "state")}  # fmt: skip
    step = ("step_response", "--set", "levels=0,80")
    asked = python("hil", "run", *step, "--bench", "brevini-hpv41", "--serial", "S", "--out", str(tmp_path / "r"))
    seen: set[str] = set()
    with subprocess.Popen(asked, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as run:
        while run.poll() is None:
            seen |= _command_lines(run.pid)
            time.sleep(0.02)
        said = run.stdout.read()
    assert run.returncode == 0 and seen and not any(SECRET in line for line in seen) and SECRET not in said
    written = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert not [path for path in written if SECRET.encode() in path.read_bytes()]


def _command_lines(group: int) -> set[str]:
    found = set()
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if os.getpgid(int(path.parent.name)) == os.getpgid(group):
                found.add(path.read_text())
        except (OSError, ValueError):
            continue
    return found
