"""When a second cause is one: what it must explain of what the first leaves, and that both are what their names say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis import causes
from hil.diagnosis.causes import Causes
from hil.diagnosis.decide import _Judge
from hil.diagnosis.measures import Measures, are_themselves
from hil.diagnosis.problem import Problem, pose
from hil.diagnosis.search.fitted import Fitted, nothing
from hil.diagnosis.search.terms import Term, all_terms
from hil.identification.estimate import Estimate, Unknown
from hil.identification.told import Slopes
from hil.physics.simulate import ActiveEffect
from tests.concealed import bound, nominal, records

COUNT = 10_000
# χ² of what leaves the 3 % of a misfit that is tolerated, and of less and more.
LITTLE, TOLERATED, TOO_MUCH = 10_200.0, 10_300.0, 10_600.0


class Stand:
    """Measures of explanations that are their χ² alone."""

    problem = None

    def __init__(self, misfit: float = 1.0) -> None:
        self.misfit = misfit

    def excess(self, chi2: float) -> float:
        return chi2 / COUNT - 1.0

    def left(self, f: Fitted) -> float:
        return self.excess(f.chi2) / self.misfit

    def gain(self, seed: Fitted, chi2: float) -> float:
        return (seed.chi2 - chi2) / (self.excess(seed.chi2) * COUNT)

    def is_adequate(self, f: Fitted) -> bool:
        return f.chi2 <= TOLERATED


def explanation(*names: str, chi2: float) -> Fitted:
    unknown = Unknown("x", "1", 1.0, 0.0, 10.0, 1.0)
    values = ((1.0,),) * len(names)
    return Fitted(tuple(_term(name, unknown) for name in names), values, {}, chi2, np.zeros(0))


def _term(name: str, unknown: Unknown) -> Term:
    return Term("effect", name, "flow", "load", (unknown,), ((1.0,),), nulls=(np.inf,))


@pytest.mark.parametrize(
    ("first", "both", "expected"),
    [
        (TOO_MUCH, 10_150.0, True),  # three quarters of what the first leaves
        (TOO_MUCH, 10_280.0, True),  # half, and together they explain what they should
        (TOO_MUCH, 10_400.0, False),  # a third
        (TOLERATED, 10_150.0, False),  # half, but the first alone explains what it should
        (12_000.0, 11_000.0, False),  # half, and both explain too little
    ],
)
def test_a_second_cause_explains_most_or_closes_what_a_law_leaves(first: float, both: float, expected: bool) -> None:
    of = Causes(Stand(), ())  # type: ignore[arg-type]
    assert of._is_pair(explanation("hysteresis", "sensor_lag", chi2=both), explanation("x", chi2=first)) is expected


@pytest.mark.parametrize(
    ("misfit", "both", "expected"), [(1e2, 11_500.0, True), (1e5, 11_500.0, False), (1e5, 10_200.0, True)]
)
def test_what_a_law_leaves_of_a_great_misfit_is_no_second_cause(misfit: float, both: float, expected: bool) -> None:
    """A first cause leaves as much as the noise: a hundredth of the misfit, or the little by which laws are off."""
    of = Causes(Stand(misfit), ())  # type: ignore[arg-type]
    pair, alone = explanation("asymmetry", "sensor_drift", chi2=both), explanation("asymmetry", chi2=20_000.0)
    assert of._is_pair(pair, alone) is expected


@pytest.mark.parametrize(("alone", "kept"), [(20_000.0, True), (10_650.0, False), (LITTLE, False)])
def test_what_takes_little_of_what_the_greater_cause_leaves_is_not_needed(
    monkeypatch: pytest.MonkeyPatch, alone: float, kept: bool
) -> None:
    """Beside the lesser cause everything looks needed."""

    def evaluated(_problem: Problem, f: Fitted) -> Fitted:
        return replace(f, chi2=alone if f.names == ("hysteresis",) else 50_000.0)

    monkeypatch.setattr(causes, "evaluated", evaluated)
    monkeypatch.setattr(causes, "roughly", lambda _problem, f: f)
    monkeypatch.setattr(causes, "polish", lambda _problem, f: f)
    both = explanation("backlash", "hysteresis", chi2=10_500.0 if alone > 10_500.0 else 10_150.0)
    found = Causes(Stand(), ()).needed(both)  # type: ignore[arg-type]
    assert found.names == (both.names if kept else ("hysteresis",))


@pytest.mark.parametrize(("least", "itself"), [(0.3, True), (0.799, False)])
def test_a_loop_of_one_width_is_backlash_and_no_hysteresis(least: float, itself: bool) -> None:
    problem = pose(nominal(), bound(nominal(), records(seed=3)[:1]))
    loop = ActiveEffect("hysteresis", "pilot", {"width": 2.0, "reach": 4.0, "least": least, "closing": 1.0})
    start = nothing(problem)
    term = next(t for t in all_terms(problem, start.residuals) if (t.name, t.hook) == loop.key)
    values = tuple(loop.parameters[u.name] for u in term.unknowns)
    slopes = 10.0 * np.random.default_rng(1).standard_normal((1000, len(values)))
    estimate = Estimate(term.unknowns, np.array(values), np.ones(1000), True, "", lambda: Slopes(slopes))
    f = replace(start, terms=(term,), values=(values,), estimate=estimate)
    assert 0.002 < estimate.std[2] < 0.01
    assert are_themselves(f) is itself


def test_pairs_that_still_fall_are_carried_on_before_they_are_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    """A dead time beside a lag falls slowly along its valley; what has settled, or is far off, is left."""
    problem = pose(nominal(), bound(nominal(), records(seed=3)[:1]))
    size = problem.size

    def fitted(name: str, excess: float, converged: bool) -> Fitted:
        f = explanation(name, "coil_lag", chi2=(1.0 + excess) * size)
        estimate = Estimate((), np.zeros(0), np.zeros(0), converged, "", lambda: Slopes(np.zeros((0, 0))))
        return replace(f, estimate=estimate)

    carried = []

    def fit(_problem: Problem, f: Fitted, **_effort: float) -> Fitted:
        carried.append(f.names[0])
        return fitted(f.names[0], 0.1, True)

    monkeypatch.setattr(causes, "fit", fit)
    of = Causes(Measures(problem, explanation(chi2=1e3 * size)), ())
    rough = [
        fitted("resonance", 0.6, True),
        fitted("dead_time", 2.0, False),
        fitted("sensor_lag", 2.0, True),
        fitted("backlash", 9.0, False),
    ]
    found = of._further(rough)
    assert carried == ["dead_time"]
    assert [round(of.m.excess(f), 3) for f in found] == [0.6, 0.1, 2.0, 9.0]


@pytest.mark.parametrize("first", [0, 1])
def test_what_cannot_be_told_from_either_of_two_causes_is_said(first: int) -> None:
    problem = pose(nominal(), bound(nominal(), records(seed=3)[:1]))
    judge = _Judge(problem, laws_only=True, most=2)
    names = ("end_stop", "dead_time")
    best = explanation(*(names if first == 0 else names[::-1]), chi2=1e4)
    as_good, worse = explanation("coil_lag", "end_stop", chi2=1e4), explanation("end_stop", "backlash", chi2=2e4)
    judge.causes.second = [as_good, worse, explanation("friction", "backlash", chi2=1e4)]
    assert judge.rivals(best, ()) == (("dead_time", "coil_lag"),)


@pytest.mark.parametrize(("chi2", "kept"), [(10_150.0, ("rate_limit",)), (11_900.0, ())])
def test_of_two_causes_of_which_one_is_not_there_the_other_one_is_kept(
    monkeypatch: pytest.MonkeyPatch, chi2: float, kept: tuple[str, ...]
) -> None:
    """A faint limit inside a stage was found only beside a dead time of nothing, and then thrown away with it."""
    monkeypatch.setattr(causes, "is_there", lambda _f, term: term.name != "dead_time")
    monkeypatch.setattr(causes, "evaluated", lambda _problem, f: f)
    monkeypatch.setattr(causes, "polish", lambda _problem, f, *, from_here: f)
    of = Causes(Stand(), ())  # type: ignore[arg-type]
    found = of._kept(explanation("dead_time", "rate_limit", chi2=chi2), explanation("coil_lag", chi2=12_000.0))
    assert tuple(name for f in found for name in f.names) == kept


PAIR, THREE, OTHER = (
    ("saturation", "end_stop"),
    ("saturation", "end_stop", "coil_lag"),
    ("saturation", "end_stop", "dead_time"),
)


@pytest.mark.parametrize(
    ("misfit", "two", "three", "other", "named"),
    [
        (100.0, 2.0, 1.01, 1.9, THREE),  # three leave nothing, and no other third comes near
        (100.0, 2.0, 1.01, 1.02, PAIR),
        (1e5, 900.0, 30.0, 800.0, THREE),  # little stays, and no other third takes half as much
        (1e5, 900.0, 30.0, 300.0, THREE),  # ... or it leaves far more
        (1e5, 900.0, 30.0, 100.0, PAIR),
        (100.0, 1.01, 1.0, 1.0, PAIR),  # two leave nothing
    ],
)
def test_a_third_cause_is_named_where_no_other_third_does_as_well(
    monkeypatch: pytest.MonkeyPatch, misfit: float, two: float, three: float, other: float, named: tuple[str, ...]
) -> None:
    """All in units of what noise leaves."""
    problem = pose(nominal(), bound(nominal(), records(seed=3)[:1]))
    judge = _Judge(problem, laws_only=True, most=2)

    def leaves(times: float, *names: str) -> Fitted:
        found = explanation(*names, chi2=times * problem.size)
        return replace(found, residuals=np.full(problem.size, np.sqrt(times)))

    judge.m = Measures(problem, leaves(misfit))
    found = [leaves(three, *THREE), leaves(other, *OTHER)]
    monkeypatch.setattr(Causes, "pairs", lambda _self, _seeds: found)
    best, _ = judge.of_three(leaves(two, *PAIR), "explained", ())
    assert best.names == named
