"""A run with a calibration that is overdue on its day carries a deviation, or is refused with nothing driven."""

from __future__ import annotations

import datetime as dt
import json
import sys
from pathlib import Path

import pytest

from hil.archive.calibrations import instruments
from hil.archive.place import archive_place
from hil.bench.find import benches
from hil.bench.nets import calibration
from hil.bench.read import read_bench
from hil.cli.app import main
from hil.record.folder import read
from hil.session.results import report_again

pytestmark = pytest.mark.usefixtures("unprinted")


def day(ahead: int = 0) -> dt.date:
    """A day as a run sees it now: not that of the import, between which and the test midnight may lie."""
    return dt.datetime.now(dt.UTC).date() + dt.timedelta(days=ahead)


@pytest.fixture(autouse=True)
def here(stranger: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HIL_ARCHIVE", str(tmp_path / "archive"))


def bench(due: dt.date, more: str = "") -> Path:
    text = benches()["brevini-hpv41"].read_text(encoding="utf-8")
    meter = f'[[instruments]]\nname = "flow meter"\nserial = "4711"\nchannel = "flow"\ndue = {due}\n\n'
    text = text.replace("[[instruments]]\n", f"{meter}[[instruments]]\n", 1)
    path = Path("bench.toml")
    path.write_text(text.replace("[protection]\n", f"[protection]\n{more}", 1), encoding="utf-8")
    return path


def run(path: Path, monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setattr(sys, "argv", ["hil", "run", "tiny_step", "--bench", str(path), "--out", "run"])
    return main()


def overdue_in_archive() -> list[tuple[Path, dt.date]]:
    found, unread = instruments(archive_place())
    assert found
    assert unread == 0
    return [(run.run, run.due) for one in found for run in one.overdue]


def test_overdue_instrument_is_a_deviation_in_header_findings_and_page(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    yesterday = day(-1)
    when = f"its calibration was due on {yesterday}; the day of this test is {day()}."
    text = f"Instrument 'flow meter' (serial 4711): {when}"
    assert run(bench(yesterday), monkeypatch) == 0
    assert f"deviation: {text}" in capsys.readouterr().out
    assert json.loads(Path("run/run.json").read_text("utf-8"))["meta"]["deviations"] == [text]
    assert text in json.loads(Path("run/results.json").read_text("utf-8"))["deviations"]
    assert f"was due on {yesterday}" in Path("run/report.html").read_text("utf-8")
    assert overdue_in_archive() == [(Path("run").resolve(), yesterday)]
    assert report_again(Path("run")).findings.deviations.count(text) == 1  # the day is that of the run


def test_overdue_channel_is_one_too(monkeypatch: pytest.MonkeyPatch) -> None:
    yesterday = day(-1)
    path = bench(day(1))
    text = path.read_text("utf-8").replace("date = 2026-03-02", f"date = 2020-03-02, due = {yesterday}", 1)
    path.write_text(text, encoding="utf-8")
    assert run(path, monkeypatch) == 0
    (deviation,) = read(Path("run")).meta["deviations"]
    assert overdue_in_archive() == [(Path("run").resolve(), yesterday)]
    assert deviation.startswith(f"Channel 'command': its calibration was due on {yesterday};")


@pytest.mark.parametrize("ahead", [0, 1])
def test_what_is_due_today_or_later_is_none(ahead: int, monkeypatch: pytest.MonkeyPatch) -> None:
    assert run(bench(day(ahead), 'overdue = "refuse"\n'), monkeypatch) == 0
    assert read(Path("run")).meta["deviations"] == []
    assert overdue_in_archive() == []


def test_overdue_run_is_refused_where_the_bench_file_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    yesterday = day(-1)
    assert run(bench(yesterday, 'overdue = "refuse"\n'), monkeypatch) == 2
    assert f"'flow meter' (serial 4711): its calibration was due on {yesterday}" in capsys.readouterr().err
    assert not Path("run").exists()


@pytest.mark.parametrize("name", sorted(benches()))
def test_no_shipped_bench_ever_falls_due(name: str) -> None:
    assert list(calibration.overdue(read_bench(benches()[name]).bench, dt.date.max)) == []
