"""Of descriptions that have no name, the corrected model holds the one that predicts best, if it predicts at all."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hil.diagnosis.answer import Answer
from hil.diagnosis.diagnosis import Fit
from hil.diagnosis.kept_back import NOTHING

# Fits of the nominal model, and of the noise alone, by their first residual.
_FITS = {5.0: 61.0, 1.0: 99.0}


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
    described = [SimpleNamespace(terms=("a term",), predicted=each) for each in predicted]
    nominal = SimpleNamespace(terms=(), residuals=np.full(3, 5.0))
    monkeypatch.setattr("hil.diagnosis.answer.fit_kept_back", lambda _problem, r, _kept: _FITS.get(float(r[0]), r[0]))
    monkeypatch.setattr("hil.diagnosis.answer.predicted", lambda _problem, f, _kept: np.full(3, f.predicted))
    monkeypatch.setattr(Answer, "has_drifted", False)
    answer: Any = object.__new__(Answer)
    answer.problem, answer.verdict, answer.kept = None, "unexplained", SimpleNamespace(said="")
    answer.choice = SimpleNamespace(chosen=described[0], descriptions=tuple(described[1:]), nominal=nominal)
    answer.named = nominal
    assert answer._used()[0] is (nominal if used is None else described[used])


def test_no_description_is_kept_that_nothing_was_kept_back_from() -> None:
    answer: Any = object.__new__(Answer)
    nominal = SimpleNamespace(terms=())
    answer.problem, answer.verdict, answer.kept = None, "unexplained", SimpleNamespace(said=NOTHING)
    answer.choice = SimpleNamespace(chosen=SimpleNamespace(terms=("a term",)), descriptions=(), nominal=nominal)
    assert answer._description() == (nominal, -np.inf)


@pytest.mark.parametrize(("after", "verdict", "is_used"), [(70.0, "explained", True), (60.9, "unexplained", False)])
def test_what_predicts_worse_than_the_nominal_model_is_neither_used_nor_named(
    after: float, verdict: str, is_used: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    nominal = SimpleNamespace(terms=(), residuals=np.full(3, 5.0))
    named = SimpleNamespace(terms=("a term",), residuals=np.full(3, 2.0))
    fits = {**_FITS, 7.0: after}
    monkeypatch.setattr("hil.diagnosis.answer.fit_kept_back", lambda _problem, r, _kept: fits[float(r[0])])
    monkeypatch.setattr("hil.diagnosis.answer.predicted", lambda _problem, _f, _kept: np.full(3, 7.0))
    answer: Any = object.__new__(Answer)
    answer.problem, answer.kept, answer.verdict, answer.events, answer.named = None, None, "explained", (), named
    answer.choice = SimpleNamespace(nominal=nominal, baseline=nominal)
    used, fit = answer._used()
    assert used is (named if is_used else nominal)
    assert answer.verdict == verdict
    assert fit == Fit(61.0, max(after, 61.0), 99.0)
