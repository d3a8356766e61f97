"""A run with a calibration that is overdue on its day carries a deviation, or is refused with nothing driven."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hil.archive.calibrations import instruments
from hil.archive.place import archive_place
from hil.bench.find import benches
from hil.bench.protection_coverage import calibration
from hil.bench.read import read_bench
from hil.record.folder import read
from hil.session.results import report_again
from tests.bench_files import bench_file
from tests.conftest import Told

pytestmark = pytest.mark.usefixtures("unprinted")


def day(ahead: int = 0) -> dt.date:
    """A day as a run sees it now: not that of the import, between which and the test midnight may lie."""
    return dt.datetime.now(dt.UTC).date() + dt.timedelta(days=ahead)


@pytest.fixture(autouse=True)
def here(stranger, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HIL_ARCHIVE", str(tmp_path / "archive"))


REFUSE = {"protection": {"overdue": "refuse"}}


def bench(due: dt.date, **tables: Any) -> Path:
    meter = {"name": "flow meter", "serial": "4711", "channel": "flow", "due": due}
    return bench_file(Path("bench.toml"), "brevini-hpv41", instruments=[meter], **tables)


Run = Callable[[Path], Told]


@pytest.fixture
def run(command_line):
    return lambda path: command_line("run", "tiny_step", "--bench", path, "--out", "run")


def overdue_in_archive() -> list[tuple[Path, dt.date]]:
    found, unread = instruments(archive_place())
    assert found
    assert unread == 0
    return [(run.run, run.due) for one in found for run in one.overdue]


def test_overdue_instrument_is_a_deviation_in_header_findings_and_page(run):
    yesterday = day(-1)
    when = f"its calibration was due on {yesterday}; the day of this test is {day()}."
    text = f"Instrument 'flow meter' (serial 4711): {when}"
    status, out, _ = run(bench(yesterday))
    assert status == 0 and f"deviation: {text}" in out
    assert json.loads(Path("run/run.json").read_text("utf-8"))["meta"]["deviations"] == [text]
    assert text in json.loads(Path("run/results.json").read_text("utf-8"))["deviations"]
    assert f"was due on {yesterday}" in Path("run/report.html").read_text("utf-8")
    assert overdue_in_archive() == [(Path("run").resolve(), yesterday)]
    assert report_again(Path("run")).findings.deviations.count(text) == 1  # the day is that of the run


def test_overdue_channel_is_one_too(run):
    yesterday = day(-1)
    line = {"calibration": {"date": dt.date(2020, 3, 2), "due": yesterday}}
    assert run(bench(day(1), channels={"command": line})).status == 0
    (deviation,) = read(Path("run")).meta["deviations"]
    assert overdue_in_archive() == [(Path("run").resolve(), yesterday)]
    assert deviation.startswith(f"Channel 'command': its calibration was due on {yesterday};")


@pytest.mark.parametrize("ahead", [0, 1])
def test_what_is_due_today_or_later_is_none(ahead, run):
    assert run(bench(day(ahead), **REFUSE)).status == 0
    assert read(Path("run")).meta["deviations"] == []
    assert overdue_in_archive() == []


def test_overdue_run_is_refused_where_the_bench_file_says_so(run):
    yesterday = day(-1)
    status, _, err = run(bench(yesterday, **REFUSE))
    assert status == 2 and f"'flow meter' (serial 4711): its calibration was due on {yesterday}" in err
    assert not Path("run").exists()


@pytest.mark.parametrize("name", sorted(benches()))
def test_no_shipped_bench_ever_falls_due(name):
    assert list(calibration.overdue(read_bench(benches()[name]).bench, dt.date.max)) == []
