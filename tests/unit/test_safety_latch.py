"""Trips stay until somebody resets them by name, also from one program to the next."""

import pytest

from hil.errors import StorageError, TrippedError, UnknownNameError
from hil.safety.latch import Latch, latch_path


def test_reset_needs_the_name_of_what_tripped(tmp_path):
    latch = Latch(tmp_path / "bench.json")
    latch.trip({"over-pressure": "150 bar"})
    with pytest.raises(UnknownNameError, match="no tripped interlock named 'pump'; known: over-pressure"):
        latch.reset("pump")
    with pytest.raises(TrippedError, match="150 bar; find the cause, then reset it with --reset 'over-pressure'"):
        latch.check()
    latch.reset("over-pressure")
    latch.check()


def test_another_program_finds_the_trip(tmp_path):
    path = tmp_path / "state" / "bench.json"
    Latch(path).trip({"over-pressure": "150 bar"})
    assert Latch(path).trips == {"over-pressure": "150 bar"}
    Latch(path).reset("over-pressure")
    Latch(path).check()


def test_unreadable_file_counts_as_a_trip(tmp_path):
    path = tmp_path / "bench.json"
    path.write_text("{", encoding="utf-8")
    with pytest.raises(TrippedError, match=r"bench\.json.*cannot be read"):
        Latch(path).check()


def test_trip_that_cannot_be_kept_is_told_and_holds(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    latch = Latch(tmp_path / "file" / "bench.json")
    with pytest.raises(StorageError, match="cannot be kept"):
        latch.trip({"over-pressure": "150 bar", "leak": "no flow"})
    with pytest.raises(TrippedError):
        latch.check()
    assert latch.trips.keys() >= {"over-pressure", "leak"}


def test_each_bench_has_its_own_file(monkeypatch, tmp_path):
    monkeypatch.setenv("HIL_STATE_DIR", str(tmp_path))
    assert latch_path("Bench 1: HPV41") == tmp_path / "trips" / "bench-1--hpv41.json"
