"""When a conclusion on a bench stops: nothing left to ask, the same asked again, or the time spent."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from hil.bench.find import find_bench
from hil.bench.read import read_bench
from hil.diagnosis.diagnosis import NextTest
from hil.session import diagnosis


def runs(monkeypatch: pytest.MonkeyPatch, asked: list[NextTest | None], took_s: float, budget_s: float) -> int:
    """How many tests are run when these are asked for one after another."""
    wanted, ran = iter(asked), []

    def diagnose(*_: Any) -> Any:
        return SimpleNamespace(diagnosis=SimpleNamespace(next_test=next(wanted)))

    def tested(_model, test, *_):
        ran.append(test)
        return SimpleNamespace(duration_s=took_s)

    monkeypatch.setattr(diagnosis, "diagnose", diagnose)
    monkeypatch.setattr(diagnosis, "_tested", tested)
    bench = read_bench(find_bench("brevini-hpv41"))
    diagnosis.conclude(None, [], bench, budget_s, Path("nowhere"))  # type: ignore[arg-type]
    return len(ran)


def steps(level: float) -> NextTest:
    return NextTest("step_response", {"levels": (level, -level)}, "", 6.0)


def test_it_ends_when_nothing_is_asked(monkeypatch):
    assert runs(monkeypatch, [steps(10.0), None], 11.0, 60.0) == 1


def test_a_test_is_not_run_twice(monkeypatch):
    assert runs(monkeypatch, [steps(10.0), steps(20.0), steps(10.0)], 11.0, 600.0) == 2


def test_the_time_that_tests_really_take_stays_within_the_budget(monkeypatch):
    asked = [steps(float(level)) for level in range(1, 20)]
    assert runs(monkeypatch, asked, 19.0, 60.0) == 3
    assert runs(monkeypatch, asked, 19.0, 13.9) == 0
