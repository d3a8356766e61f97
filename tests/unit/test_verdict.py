"""What the one score promises: of nested models, of noise, of names, and of severity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.measures import CONSISTENT_EXCESS, NEARLY_ALL
from hil.diagnosis.search.fitted import Fitted
from hil.diagnosis.search.terms import Term
from hil.diagnosis.shadow import as_dict, as_hypothesis, there
from hil.diagnosis.verdict import (
    Hypothesis,
    Kind,
    Question,
    anything,
    marginal,
    question,
    score,
    verdict_of,
    weighed,
)
from hil.identification.estimate import Unknown

COUNT = 20_000
CAUSES = {f"cause {k}": 1 + k % 4 for k in range(25)}  # with their number of unknowns


def asked(beyond: float) -> Question:
    """A misfit of so many times the noise's variance."""
    return Question(COUNT, COUNT * (1.0 + beyond), 25, samples=COUNT, unknowns=2)


def law(*names: str, leaves: float, of: float, unknowns: int = 2, kind: Kind = "effects") -> Hypothesis:
    """An explanation that leaves this share of a misfit."""
    left = COUNT * (1.0 + leaves * of)
    if kind == "parameters":
        return Hypothesis(frozenset({kind}), (), left, unknowns, 0, changed=names)
    return Hypothesis(frozenset({kind}), names, left, unknowns, len(names))


def nothing(of: float) -> Hypothesis:
    return Hypothesis(frozenset({"nothing"}), (), COUNT * (1.0 + of), 0, 0)


def told(beyond: float, *hypotheses: Hypothesis) -> str:
    posed = asked(beyond)
    return verdict_of(weighed(posed, [nothing(beyond), anything(posed), *hypotheses])[0].hypothesis)


@pytest.mark.parametrize("beyond", [0.1, 1.0, 30.0, 3000.0])
def test_a_law_that_leaves_noise_is_the_explanation(beyond: float) -> None:
    assert told(beyond, law("friction", leaves=0.0, of=beyond)) == "explained"


def test_without_a_misfit_nothing_is_there() -> None:
    assert told(0.0, law("friction", leaves=0.0, of=0.0)) == "consistent"


@pytest.mark.parametrize("beyond", [3.0, 300.0])
def test_a_law_that_leaves_a_third_is_something_unknown(beyond: float) -> None:
    assert told(beyond, law("friction", leaves=1 / 3, of=beyond)) == "unexplained"


def test_a_parameter_that_changed_is_preferred_to_a_law_that_says_no_more() -> None:
    changed = law("gain", leaves=0.0, of=5.0, unknowns=1, kind="parameters")
    assert told(5.0, changed, law("asymmetry", leaves=0.0, of=5.0)) == "parameter_change"


def test_of_nested_models_the_smaller_one_is_kept_unless_the_other_tells_more() -> None:
    posed = asked(10.0)
    one = law("friction", leaves=1e-3, of=10.0)
    no_better = law("friction", "backlash", leaves=0.97e-3, of=10.0, unknowns=3)
    much_better = law("friction", "backlash", leaves=0.0, of=10.0, unknowns=3)
    far = replace(one, chi2=COUNT * 1.2)
    assert score(posed, one) < score(posed, no_better)
    assert score(posed, much_better) < score(posed, far)


def test_what_samples_repeat_says_no_more_than_they_do() -> None:
    """A recording eight times as fast of the same misfit, whose samples then say the same eight times."""
    one, two = law("a", leaves=0.01, of=100.0), law("a", "b", leaves=0.00999, of=100.0, unknowns=4)
    differences = []
    for faster in (1, 8):
        posed = question(COUNT * faster, COUNT * faster * 101.0, COUNT * faster, CAUSES, colour=faster)
        scaled = [replace(h, chi2=h.chi2 * faster) for h in (one, two)]
        differences.append(score(posed, scaled[1]) - score(posed, scaled[0]))
    assert differences[0] == pytest.approx(differences[1])
    assert min(differences) > 0.0


def test_names_are_only_names() -> None:
    posed = asked(4.0)
    assert score(posed, law("friction", leaves=0.02, of=4.0)) == score(posed, law("leakage", leaves=0.02, of=4.0))
    first, second = weighed(posed, [law(name, leaves=0.01, of=4.0) for name in ("friction", "backlash")])
    assert first.probability == pytest.approx(second.probability) == pytest.approx(0.5)


def test_more_of_an_effect_is_no_less_probable() -> None:
    said = []
    for beyond in (0.0005, 0.01, 0.05, 0.3, 2.0, 20.0):
        posed = asked(beyond)
        ranked = weighed(posed, [nothing(beyond), anything(posed), law("friction", leaves=0.0, of=beyond)])
        said.append(marginal(ranked, "friction"))
    assert np.all(np.diff(said) >= -1e-9)
    assert said[0] < 0.5 < said[-1]


def test_every_member_of_a_set_has_its_own_probability() -> None:
    posed = asked(50.0)
    first = law("friction", leaves=0.012, of=50.0)
    both = law("friction", "leakage", leaves=0.01198, of=50.0, unknowns=3)
    ranked = weighed(posed, [nothing(50.0), anything(posed), first, both])
    assert marginal(ranked, "leakage") < marginal(ranked, "friction")
    assert sum(w.probability for w in ranked) == pytest.approx(1.0)


def test_noise_is_what_the_best_explanation_leaves_if_that_is_little_more() -> None:
    assert question(COUNT, 2.0 * COUNT, 1.03 * COUNT, CAUSES).count == pytest.approx(1.03 * COUNT)
    assert question(COUNT, 2.0 * COUNT, 1.5 * COUNT, CAUSES).count == pytest.approx((1.0 + CONSISTENT_EXCESS) * COUNT)
    assert question(COUNT, 2.0 * COUNT, 0.9 * COUNT, CAUSES).count == COUNT


@pytest.mark.parametrize("times", [0.5, 2.0])
def test_a_law_gives_way_to_something_unknown_where_it_leaves_more_than_that_would(times: float) -> None:
    beyond = 1e6
    said = told(beyond, law("friction", leaves=times * NEARLY_ALL, of=beyond))
    assert said == ("explained" if times < 1.0 else "unexplained")


def test_what_ended_at_nothing_is_no_part_of_a_hypothesis() -> None:
    """A pair of which one member does nothing is the other one alone, and costs as much."""
    width = Unknown("width", "%", 1.0, 0.0, 10.0, 1.0)
    play = Term("effect", "backlash", "position", "spool", (width,), ((1.0,),), nulls=(0.0,))
    lag = replace(play, name="coil_lag")
    both = Fitted((play, lag), ((0.0005,), (0.3,)), {}, 1.0, np.zeros(0))
    assert there(both).names == ("coil_lag",)
    assert there(replace(both, values=((0.3,), (0.3,)))).names == ("backlash", "coil_lag")


@pytest.mark.parametrize(
    ("telling", "value", "name"),
    [("ends", 0.05, ()), ("ends", 8.0, ()), ("ends", 3.0, ("supply_droop",)), ("upper end", 0.05, ("supply_droop",)),
     ("upper end", 8.0, ()), ("", 8.0, ("supply_droop",))],
)  # fmt: skip
def test_a_law_without_the_shape_that_tells_it_from_others_has_no_name(
    telling: str, value: float, name: tuple[str, ...]
) -> None:
    """A supply whose pressure falls at once bends the static curve, as a spring does that nobody has written down."""
    recovery = Unknown("recovery", "s", 1.0, 0.05, 8.0, 1.0)
    marks = (("recovery", telling),) if telling else ()
    droop = Term("effect", "supply_droop", "supply", "tank", (recovery,), ((1.0,),), nulls=(0.0,), telling=marks)
    told = as_hypothesis(Fitted((droop,), ((value,),), {}, 1.0, np.zeros(0)))
    assert (told.names, "unknown" in told.kinds) == (name, not name)


@pytest.mark.parametrize(("colour", "said"), [(1.0, "explained"), (3.3, "consistent")])
def test_what_slow_noise_does_is_no_cause(colour: float, said: str) -> None:
    """A healthy EFC whose noise had a memory of 100 samples: a slow tone gained 72 in χ²."""
    tone = Hypothesis(frozenset({"effects"}), ("periodic_disturbance",), 33_307.0, 3, 1)
    posed = question(33_294, 33_379.0, tone.chi2, CAUSES, colour)
    as_it_was = Hypothesis(frozenset({"nothing"}), (), 33_379.0, 0, 0)
    assert verdict_of(weighed(posed, [as_it_was, anything(posed), tone])[0].hypothesis) == said


def test_parameters_that_changed_are_no_effects_even_beside_events() -> None:
    gain = Hypothesis(frozenset({"parameters"}), (), COUNT, 1, 0, changed=("gain",))
    ranked = weighed(asked(5.0), [h.beside([("dropout", "")]) for h in (nothing(5.0), gain)])
    said = as_dict(ranked)
    assert (said["verdict"], said["names"]) == ("explained", ["dropout"])
    assert said["hypotheses"][0]["name"] == "dropout + gain"


def test_events_that_were_taken_out_stand_beside_whatever_explains_the_rest() -> None:
    nothing = Hypothesis(frozenset({"nothing"}), (), COUNT, 0, 0)
    friction = law("friction", leaves=0.0, of=1.0)
    offset = law("sensor_offset", leaves=0.0, of=1.0)
    events = [("dropout", ""), ("quantisation", "sensor_offset")]
    assert (nothing.beside([]), friction.beside([])) == (nothing, friction)
    assert verdict_of(nothing.beside(events)) == "explained"
    assert nothing.beside(events).names == ("dropout", "quantisation")
    assert friction.beside(events).names == ("dropout", "quantisation", "friction")
    assert offset.beside(events).names == ("dropout", "quantisation")  # only another side of the coarse channel
    assert verdict_of(anything(asked(1.0)).beside(events)) == "partly_explained"
    misfit = replace(nothing, chi2=2.0 * COUNT)
    (best, *_) = weighed(asked(1.0), [h.beside(events) for h in (misfit, friction)])
    assert (best.hypothesis.names, best.hypothesis.chi2) == (friction.beside(events).names, friction.chi2)
