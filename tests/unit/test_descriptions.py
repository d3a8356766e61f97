"""Of descriptions that have no name, the corrected model holds the one that predicts best, if it predicts at all."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from hil.diagnosis.answer import Answer
from hil.diagnosis.diagnosis import Fit


@pytest.mark.parametrize(
    ("predicted", "used"),
    [
        ((66.0, 69.0, 64.0), 1),
        ((70.0, 69.0, 64.0), 0),
        ((61.0, 62.0, 62.5), None),  # a twentieth of the gap is 1.9
        ((61.0, 62.0, 62.5, 61.0, 90.0), None),  # only the closest four are asked
    ],
)
def test_the_description_that_predicts_best_is_kept(
    predicted: tuple[float, ...], used: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    described = [SimpleNamespace(terms=("a term",), residuals=[], predicted=each) for each in predicted]
    nominal = SimpleNamespace(terms=(), residuals="those of the nominal model")
    monkeypatch.setattr("hil.diagnosis.answer.cross_validated_fit", lambda _problem, f: f.predicted)
    monkeypatch.setattr("hil.diagnosis.answer.fit_of_all", lambda _problem, r: 61.0 if r is nominal.residuals else 99.0)
    monkeypatch.setattr(Answer, "_held_out", lambda _self, _used: Fit(62.0, 62.0, 99.0))
    answer: Any = object.__new__(Answer)
    answer.problem, answer.verdict = None, "unexplained"
    answer.choice = SimpleNamespace(chosen=described[0], descriptions=tuple(described[1:]), nominal=nominal)
    answer.named = nominal
    kept, held_out = answer._used()
    assert kept is (nominal if used is None else described[used])
    assert held_out == Fit(62.0, 62.0, 99.0) if used is None else held_out.corrected == predicted[used]
