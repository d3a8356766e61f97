"""`hil check --reference`: a bench that is as it was, one whose meter reads 2 % more, and the first time."""

import datetime as dt
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.bench_files import bench_file

pytestmark = pytest.mark.usefixtures("unprinted")


@pytest.fixture
def bench(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HIL_ARCHIVE", str(tmp_path / "runs"))
    return tmp_path / "bench.toml"


Checked = Callable[..., tuple[int, str]]


@pytest.fixture
def checked(bench, command_line):
    """Exit status of `hil check --reference` of a bench with such values, and what it prints."""

    def run(*more, **tables):
        bench_file(bench, "brevini-hpv41", sample_rate_hz=200, **tables)
        return command_line("check", bench, "--reference", "REF 1", *more)[:2]

    return run


def test_the_first_time_is_kept_and_a_bench_as_it_was_is_said_to_be_so(checked):
    status, first = checked()
    assert status == 0 and "no faults" in first and "differs" not in first
    (kept,) = Path("runs").glob("bench_reference-REF-1-*")
    status, text = checked("--json", simulation={"seed": 12})
    assert text, status
    answer = json.loads(text)
    assert status == 0 and answer["schema"] == "hil.run-comparison/1"
    assert answer["serials"] == ["REF 1", "REF 1"] and answer["runs"][0] == kept.name
    assert {one["meaning"] for one in answer["differences"]} == {"within uncertainty", "cannot tell"}


def test_a_meter_that_reads_two_per_cent_more_is_an_exit_status_of_one(checked):
    checked()
    status, text = checked(simulation={"seed": 12, "instruments": {"flow": {"slope": 9.8}}})
    assert status == 1
    differing = [line.split()[0] for line in text.splitlines() if line.endswith("differs")]
    assert {"gain_positive", "gain_negative", "response_high"} <= set(differing)


def test_nothing_is_driven_where_strict_refuses_or_the_bench_is_read(checked):
    status, text = checked("--live")
    assert status == 2 and not text
    overdue = {"date": dt.date(2019, 3, 2), "due": dt.date(2020, 3, 2)}
    status, text = checked("--strict", channels={"command": {"calibration": overdue}})
    assert status != 0 and "warning" in text
    assert not Path("runs").exists()


def test_json_of_the_first_time_has_no_differences(checked):
    status, text = checked("--json")
    answer = json.loads(text)
    assert status == 0 and answer["schema"] == "hil.run-comparison/1" and answer["differences"] == []
    assert [Path("runs", name).is_dir() for name in answer["runs"]] == [True]
