"""`hil check --reference`: a bench that is as it was, one whose meter reads 2 % more, and the first time."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from hil.bench.find import benches


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HIL_ARCHIVE", str(tmp_path / "runs"))
    path = tmp_path / "bench.toml"
    text = benches()["brevini-hpv41"].read_text(encoding="utf-8")
    path.write_text(text.replace("sample_rate_hz = 1000", "sample_rate_hz = 200"), encoding="utf-8")
    return path


Checked = Callable[..., tuple[int, str]]


@pytest.fixture
def checked(bench: Path, command_line) -> Checked:
    """Exit status of `hil check --reference` after a change of the bench, and what it prints."""

    def run(*more: str, seed: int = 1, change: tuple[str, str] = ("", "")) -> tuple[int, str]:
        text = bench.read_text(encoding="utf-8").replace("seed = 1", f"seed = {seed}")
        assert change[0] in text
        bench.write_text(text.replace(*change) if change[0] else text, encoding="utf-8")
        return command_line("check", bench, "--reference", "REF 1", *more)[:2]

    return run


def test_the_first_time_is_kept_and_a_bench_as_it_was_is_said_to_be_so(checked: Checked) -> None:
    status, first = checked()
    assert status == 0 and "no faults" in first and "differs" not in first
    (kept,) = Path("runs").glob("bench_reference-REF-1-*")
    status, text = checked("--json", seed=12)
    assert text, status
    answer = json.loads(text)
    assert status == 0 and answer["schema"] == "hil.run-comparison/1"
    assert answer["serials"] == ["REF 1", "REF 1"] and answer["runs"][0] == kept.name
    assert {one["meaning"] for one in answer["differences"]} == {"within uncertainty", "cannot tell"}


def test_a_meter_that_reads_two_per_cent_more_is_an_exit_status_of_one(checked: Checked) -> None:
    checked()
    status, text = checked(seed=12, change=("noise = 0.3", "noise = 0.3, slope = 9.8"))
    assert status == 1
    differing = [line.split()[0] for line in text.splitlines() if line.endswith("differs")]
    assert {"gain_positive", "gain_negative", "response_high"} <= set(differing)


def test_nothing_is_driven_where_strict_refuses_or_the_bench_is_read(checked: Checked) -> None:
    status, text = checked("--live")
    assert status == 2 and not text
    status, text = checked("--strict", change=("date = 2026-03-02", "date = 2019-03-02, due = 2020-03-02"))
    assert status != 0 and "warning" in text
    assert not Path("runs").exists()


def test_json_of_the_first_time_has_no_differences(checked: Checked) -> None:
    status, text = checked("--json")
    answer = json.loads(text)
    assert status == 0 and answer["schema"] == "hil.run-comparison/1" and answer["differences"] == []
    assert [Path("runs", name).is_dir() for name in answer["runs"]] == [True]
