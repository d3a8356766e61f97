"""Which explanations are fitted to their end, and what is said of how probable they are."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hil.diagnosis import causes
from hil.diagnosis.answer import Answer
from hil.diagnosis.causes import Causes
from hil.diagnosis.decide import decide
from hil.diagnosis.evidence import Judged, calibrated, probabilities
from hil.diagnosis.happened import Happened
from hil.diagnosis.measures import Measures
from hil.diagnosis.problem import Problem, pose
from hil.diagnosis.question import Question
from hil.diagnosis.search import polish as polishing
from hil.diagnosis.search.fitted import Fitted
from hil.diagnosis.search.polish import polish
from hil.diagnosis.search.terms import Term
from hil.identification.estimate import Unknown
from hil.physics.simulate import ActiveEffect
from tests.concealed import bound, nominal, records
from tests.proof.cases.label import PARAMETER
from tests.proof.score.result import Result, of

COUNT = 10_000
ASKED = Question("left_out", "no table")
PUBLISHED = Path(__file__).parents[1] / "proof" / "published.json"


def cases() -> list[Result]:
    """Of the concealment proof, those that show."""
    found = [of(fields) for fields in json.loads(PUBLISHED.read_text())["cases"]]
    return [r for r in found if r.visible and r.kind != PARAMETER]


def explanation(name: str, chi2: float, unknowns: int = 1) -> Fitted:
    own = tuple(Unknown(f"x{k}", "1", 1.0, 0.0, 10.0, 1.0) for k in range(unknowns))
    term = Term("effect", name, "flow", "load", own, ((1.0,) * unknowns,), nulls=(np.inf,))
    return Fitted((term,), ((1.0,) * unknowns,), {}, chi2, np.zeros(0))


def judged(f: Fitted, held_out: float) -> Judged:
    return Judged(f, 99.0, held_out, COUNT // 2, 0.0)


def test_what_was_chosen_is_no_less_probable_than_what_cannot_be_told_from_it() -> None:
    chosen = judged(explanation("saturation", 10_000.0, unknowns=3), 5_000.0)
    same = judged(explanation("end_stop", 10_010.0), 4_999.0)
    first, second = probabilities([chosen, same], 0.02)
    assert first == pytest.approx(second) == pytest.approx(0.49)


def test_what_data_kept_back_prefer_may_be_more_probable_than_what_was_chosen() -> None:
    chosen = judged(explanation("saturation", 10_000.0, unknowns=3), 5_400.0)
    other = judged(explanation("end_stop", 11_000.0), 5_000.0)
    first, second = probabilities([chosen, other], 0.02)
    assert first < 0.1 < second


def test_what_is_said_rises_with_the_evidence_and_is_never_certain() -> None:
    said = [calibrated(p) for p in np.linspace(0.0, 0.99, 100)]
    assert said == sorted(set(said))
    assert said[0] == 0.0
    assert said[-1] < 0.99


def test_what_is_said_of_a_name_comes_nearer_to_how_often_it_was_right() -> None:
    """On the names that it was fitted to: a slip in the map shows here. Others are in docs/explanation/proof.md."""
    names = [(p, name in r.effects) for r in cases() for name, p in zip(r.named, r.probabilities, strict=True)]
    assert len(names) > 400
    before, after = (np.mean([(said(p) - right) ** 2 for p, right in names]) for said in (float, calibrated))
    assert after < 0.75 * before


class Stand:
    """Measures of explanations that are their χ² alone."""

    problem = None

    def excess(self, f: Fitted) -> float:
        return f.chi2 / COUNT - 1.0

    def cost(self, f: Fitted) -> float:
        return f.chi2 + f.unknowns

    def burden(self, f: Fitted) -> float:
        return self.cost(f) / COUNT - 1.0

    def is_adequate(self, f: Fitted) -> bool:
        return self.excess(f) < 0.03


@pytest.mark.parametrize(
    ("lowest", "expected"),
    [
        (10_000.0, ["saturation", "coil_lag", "sensor_lag"]),  # the second one explains: what is near it is fitted too
        (13_000.0, ["saturation", "coil_lag"]),  # nothing explains: no more than two
    ],
)
def test_what_may_be_as_good_as_an_explanation_is_fitted_too(
    monkeypatch: pytest.MonkeyPatch, lowest: float, expected: list[str]
) -> None:
    def polish(_problem: Problem, f: Fitted) -> Fitted:
        return explanation(f.names[0], 12_000.0 if f.names[0] == "saturation" else lowest)

    monkeypatch.setattr(causes, "polish", polish)
    singles = [
        explanation("saturation", 13_000.0),
        explanation("coil_lag", 13_500.0),
        explanation("coil_lag", 13_600.0),  # the same name at another place
        explanation("sensor_lag", 16_000.0),
        explanation("deadband", 40_000.0),  # far behind
    ]
    found = Causes(Stand(), ()).polished(singles)  # type: ignore[arg-type]
    assert [f.names[0] for f in found] == expected


@pytest.mark.parametrize("first", [0, 1])
def test_pairs_that_share_a_rugged_term_are_compared_in_one_valley(monkeypatch: pytest.MonkeyPatch, first: int) -> None:
    """The more economical of two pairs ended in a wrong valley of friction, the other one in the right one."""

    def pair(name: str, size: float, unknowns: int) -> Fitted:
        lag, friction = explanation(name, 0.0, unknowns), explanation("friction", 0.0)
        terms = (lag.terms[0], replace(friction.terms[0], rugged=True))
        return Fitted(terms, (lag.values[0], (size,)), {}, 10_000.0 + 1_000.0 * abs(size - 3.0) + unknowns, np.zeros(0))

    to_the_end = []

    def fit(_problem: Problem, f: Fitted, **_effort: float) -> Fitted:
        if f.names == ("backlash",):
            return f
        return pair(f.terms[0].name, f.values[1][0], len(f.values[0]))  # it stays in the valley that it is in

    def polish(problem: Problem, f: Fitted) -> Fitted:
        to_the_end.append(f.names[0])
        return fit(problem, f)

    monkeypatch.setattr(causes, "fit", fit)
    monkeypatch.setattr(causes, "polish", polish)
    right, economical, other = pair("coil_lag", 3.0, 4), pair("dead_time", 5.0, 1), explanation("backlash", 10_500.0)
    pairs = [economical, right, other] if first == 0 else [right, economical, other]
    both = Causes(Stand(), ())._to_the_end(pairs)  # type: ignore[arg-type]
    assert both.names == ("dead_time", "friction")
    assert both.values[1] == (3.0,)
    assert "backlash" in to_the_end  # it leaves little more


def test_what_leaves_much_more_than_another_pair_is_not_fitted_to_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    to_the_end = []

    def polish(_problem: Problem, f: Fitted) -> Fitted:
        to_the_end.append(f.names[0])
        return f

    monkeypatch.setattr(causes, "polish", polish)
    pairs = [explanation("leakage", 10_400.0), explanation("coil_lag", 10_700.0), explanation("backlash", 10_900.0)]
    assert Causes(Stand(), ())._to_the_end(pairs) is pairs[0]  # type: ignore[arg-type]
    assert to_the_end == ["leakage", "coil_lag"]


@pytest.mark.parametrize(("rugged", "moved", "starts"), [(True, 0.5, 2), (True, 0.01, 1), (False, 0.5, 1)])
def test_a_rugged_term_that_pulled_parameters_far_off_is_fitted_from_nominal_ones_too(
    monkeypatch: pytest.MonkeyPatch, rugged: bool, moved: float, starts: int
) -> None:
    """From there it may have a way to a valley that the parameters, once they have bent to a wrong one, shut off."""
    problem = pose(nominal(), bound(nominal(), records(seed=15)))
    p = problem.base[1]
    at_home, single = problem.model.values[p.name], explanation("friction", 0.0)
    asked = []

    def fit(_problem: Problem, f: Fitted, **_effort: float) -> Fitted:
        asked.append(f.parameters[p.name])
        return replace(f, chi2=12_000.0 if f.parameters[p.name] == at_home else 14_000.0)

    monkeypatch.setattr(polishing, "fit", fit)
    bent = problem.model.values | {p.name: at_home + moved * abs(at_home)}
    found = polish(problem, replace(single, terms=(replace(single.terms[0], rugged=rugged),), parameters=bent))
    assert len(dict.fromkeys(asked)) == starts
    assert found.chi2 == (12_000.0 if starts == 2 else 14_000.0)


def test_what_data_kept_back_speak_against_is_not_named() -> None:
    widened = ActiveEffect("deadband", "opening", {"width": 4.0, "ratio": 1.0})
    problem = pose(nominal(), bound(nominal(), records((widened,), seed=21)))
    choice = decide(problem)
    assert Answer(Happened((), problem, choice), (), None, ASKED).verdict == "explained"
    wrong = next(f for f in choice.candidates if f.names and f.names[0] != "deadband")
    doubted = replace(choice, verdict="partly_explained", chosen=wrong)
    answer = Answer(Happened((), problem, doubted), (), None, ASKED)
    assert answer.verdict == "unexplained"
    assert answer.diagnosis(0.0).effects == ()


@pytest.mark.parametrize(("beyond", "full"), [(0.8, True), (1.5, False)])
def test_what_is_left_of_the_output_is_not_hidden_by_inner_signals(beyond: float, full: bool) -> None:
    """Two channels: the inner one, in which the misfit was a thousand times the noise, is explained."""
    problem = pose(nominal(), bound(nominal(), records(seed=15, with_spool=True)))
    residuals = np.ones(problem.size)
    for part in problem.output_slices():
        residuals[part] *= np.sqrt(1.0 + beyond)
    baseline = Fitted((), (), {}, 1e3 * problem.size, np.zeros(0))
    explained = Fitted((), (), {}, float(residuals @ residuals), residuals)
    m = Measures(problem, baseline)
    assert m.excess(explained) < 1.0
    assert m.is_full(explained) is full
