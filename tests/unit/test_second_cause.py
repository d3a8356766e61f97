"""When a second cause is one: what it must explain of what the first leaves, and that both are what their names say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnose import causes
from hil.diagnose.causes import Causes
from hil.diagnose.measures import are_themselves
from hil.diagnose.problem import Problem, pose
from hil.diagnose.search.fitted import Fitted, nothing
from hil.diagnose.search.terms import all_terms
from hil.identify.estimate import Estimate, Unknown
from hil.physics.simulate import ActiveEffect
from tests.concealed import bound, nominal, records

COUNT = 10_000
# χ² of what leaves the 3 % of a misfit that is tolerated, and of less and more.
LITTLE, TOLERATED, TOO_MUCH = 10_200.0, 10_300.0, 10_600.0


class Stand:
    """Measures of explanations that are their χ² alone."""

    problem = None

    def excess(self, chi2: float) -> float:
        return chi2 / COUNT - 1.0

    def gain(self, seed: Fitted, chi2: float) -> float:
        return (seed.chi2 - chi2) / (self.excess(seed.chi2) * COUNT)

    def is_adequate(self, f: Fitted) -> bool:
        return f.chi2 <= TOLERATED


def explanation(*names: str, chi2: float) -> Fitted:
    unknown = Unknown("x", "1", 1.0, 0.0, 10.0, 1.0)
    values = ((1.0,),) * len(names)
    return Fitted(tuple(_term(name, unknown) for name in names), values, {}, chi2, np.zeros(0))


def _term(name: str, unknown: Unknown) -> causes.Term:
    return causes.Term("effect", name, "flow", "load", (unknown,), ((1.0,),), null=np.inf)


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
    estimate = Estimate(term.unknowns, np.array(values), np.ones(1000), True, "", lambda: slopes)
    f = replace(start, terms=(term,), values=(values,), estimate=estimate)
    assert 0.002 < estimate.std[2] < 0.01
    assert are_themselves(f) is itself
