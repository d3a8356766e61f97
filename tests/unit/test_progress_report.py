"""What the operator is told: one time over a whole sequence, never back, with live values."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
import pytest

from hil.bench.find import find_bench
from hil.bench.open import open_rig
from hil.bench.progress_report import ProgressReporter, Shown, time_text
from hil.bench.read import read_bench
from hil.record.folder import read
from hil.session.procedure import load_procedure
from hil.session.setting import parse_settings

NAN = float("nan")


def heard_by(monkeypatch: pytest.MonkeyPatch) -> tuple[ProgressReporter, list[tuple[float, str]]]:
    """One who hears every block, however fast they come."""
    monkeypatch.setattr("hil.bench.progress_report._EVERY_S", 0.0)
    said: list[tuple[float, str]] = []
    return ProgressReporter(
        lambda *one: said.append(one), [Shown("current", "A", 2.2), Shown("pressure", "psi", 300.0)]
    ), said


def block(told: ProgressReporter, until_s: float, current: float = 1.2, pressure: float = 141.04) -> None:
    told.heard(np.array([until_s]), {"current": np.array([current]), "pressure": np.array([pressure])})


def test_a_sequence_has_one_time_over_all_its_parts(monkeypatch):
    told, said = heard_by(monkeypatch)
    with told.before(30.0):
        told.expect(10.0)
        told.say(0.9, "coil")
        block(told, 10.0)
    told.expect(30.0)
    told.say(0.0, "steps")
    block(told, 25.0)
    block(told, 41.0)
    assert [share for share, _ in said] == [0.0, 0.25, 0.25, 0.625, 0.99]
    assert said[3][1] == "steps; 15 s left; current 1.200 A, pressure 141.0 psi"
    assert "almost done" in said[4][1]


def test_a_part_that_takes_longer_stands_still_and_says_so(monkeypatch):
    told, said = heard_by(monkeypatch)
    told.expect(10.0)
    block(told, 9.0)
    block(told, 12.0, NAN, NAN)
    told.expect(50.0)
    block(told, 13.0)
    assert [share for share, _ in said] == [0.9, 0.99, 0.99]
    assert said[1][1] == "longer than expected; current not measured, pressure not measured"
    assert said[2][1].startswith("49 s left")


def test_where_no_time_is_known_the_procedure_says_how_far_it_is(monkeypatch):
    told, said = heard_by(monkeypatch)
    told.say(0.4, "by hand")
    block(told, 1.0)
    assert said == [(0.4, "by hand"), (0.4, "by hand; current 1.200 A, pressure 141.0 psi")]
    assert [time_text(s) for s in (45.0, 380.0, 3900.0)] == ["45 s", "6 min 20 s", "1 h 5 min"]


def test_the_acceptance_of_an_efc_tells_the_time_of_the_whole(tmp_path, monkeypatch):
    """Against the bench's own clock: what was said to be left at each moment is what then came."""
    monkeypatch.setattr("hil.bench.progress_report._EVERY_S", 0.0)
    said: list[tuple[float, str]] = []
    bench = read_bench(find_bench("cummins-efc-acceptance"))
    settings = {"sweep_s": "2", "frequencies": "8", "levels": "medium", "rate_hz": "500"}
    procedure = load_procedure("efc_acceptance")
    with open_rig(bench, tmp_path / "run", {}, lambda *one: said.append(one)) as rig:
        procedure.run(rig, **parse_settings(procedure.settings, settings))
    shares = [share for share, _ in said]
    assert all(later >= sooner for sooner, later in pairwise(shares))
    assert max(later - sooner for sooner, later in pairwise(shares)) < 0.1
    assert "coil current" in said[len(said) // 2][1]
    whole_s = read(tmp_path / "run").duration_s
    first = next(text for _, text in said if " left" in text)
    minutes, seconds = re.search(r"(?:(\d+) min )?(\d+) s of simulated time left", first).groups()  # type: ignore[union-attr]
    assert 60 * int(minutes or 0) + int(seconds) == pytest.approx(whole_s, rel=0.1)
