"""A diagnosis whose computing time is over says what it left out."""

from __future__ import annotations

import math

from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.intake.work import Work
from hil.physics.simulate import ActiveEffect
from tests.concealed import bound, nominal, records


def test_without_a_budget_nothing_is_left_out():
    work = Work()
    assert not work.leaves_out("anything")
    assert work.warnings == ()


def test_what_there_is_no_time_for_is_said_once():
    said: list[tuple[float, str]] = []
    work = Work(lambda share, text: said.append((share, text)), 0.0)
    work.at(0.5, "here")
    assert work.leaves_out("two causes") and work.leaves_out("two causes")
    assert said == [(0.5, "here")]
    assert work.as_dict()["not_searched"] == ["two causes"]
    (warning,) = work.warnings
    assert "0 s" in warning and warning.count("two causes") == 1 and "a larger budget" in warning


def test_a_diagnosis_without_time_still_answers():
    model = nominal(0.0)
    pair = [ActiveEffect("deadband", "opening", {"width": 6.0, "ratio": 1.0}),
            ActiveEffect("sensor_lag", "sensor", {"first": 0.06, "second": 0.0})]  # fmt: skip
    found = diagnose(model, bound(model, records(pair[:1], seed=3)), budget_s=0.0).diagnosis
    assert found.verdict in ("explained", "partly_explained", "unexplained")
    assert math.isfinite(found.held_out.corrected)
