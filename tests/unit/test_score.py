"""What the one score promises, and the verdict that is read off its table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.verdict.score import Hypothesis, Noise, Table, score, table

NOISE = Noise(count=20_000.0, least=1.0, most=1.06, samples=20_000.0, names=30)


def law(*names: str, left: float, unknowns: int = 2) -> Hypothesis:
    """A set of effects that leaves so much beyond noise."""
    return Hypothesis(names, NOISE.count + left, len(names), unknowns * len(names))


def of(nothing: float, *others: Hypothesis) -> Table:
    return table(NOISE, [Hypothesis((), NOISE.count + nothing), *others])


def verdict(found: Table) -> str:
    return found.first.verdict


@pytest.mark.parametrize("misfit", [2e3, 2e4, 2e6])
def test_verdict_a_law_down_to_noise_is_explained(misfit):
    assert verdict(of(misfit, law("friction", left=0.0))) == "explained"


def test_verdict_without_a_misfit_is_consistent():
    assert verdict(of(100.0, law("friction", left=0.0))) == "consistent"


def test_verdict_noise_stated_a_little_too_small_is_no_misfit():
    assert verdict(of(0.05 * NOISE.count, law("friction", left=0.05 * NOISE.count - 50.0))) == "consistent"


def test_verdict_a_parameter_goes_before_a_law_that_says_no_more():
    gain = Hypothesis((), NOISE.count, 1, 1, changed=("gain",))
    assert verdict(of(1e5, gain, law("asymmetry", left=0.0))) == "parameter_change"


def test_verdict_where_nothing_comes_near_is_unexplained():
    found = of(1e5, law("friction", left=5e4))
    assert verdict(found) == "unexplained"
    assert found.first.label == "something unknown"


def test_verdict_where_more_than_600_is_left_something_unknown_stands_beside():
    known = replace(NOISE, most=1.0)
    told = [verdict(table(known, [Hypothesis((), 1e6), law("friction", left=left)])) for left in (450.0, 700.0)]
    assert told == ["explained", "partly_explained"]


def test_parameters_that_something_unknown_has_bent_are_one_cause():
    first = of(1e6, replace(law("friction", left=5_000.0), causes=4, moved=3)).first
    assert (first.label, first.causes) == ("friction + something unknown", 3)


def test_parameters_that_moved_are_causes_where_little_is_left():
    rows = of(2e4, replace(law("friction", left=50.0), causes=4, moved=3)).rows
    assert {row.causes for row in rows if row.hypothesis.named} == {4, 5}


def test_a_name_beside_something_unknown_stands_alone():
    near, far = law("backlash", left=12_000.0), law("backlash", left=25_000.0)
    friction = law("friction", left=5_000.0)
    assert verdict(of(1e6, friction, far)) == "partly_explained"
    resembles = of(1e6, friction, near)
    assert verdict(resembles) == "unexplained"
    assert resembles.alike == ("friction", "backlash")


def test_table_a_rival_pays_for_every_cause_that_it_has_more():
    one, more = law("friction", left=5_000.0), law("backlash", "dead_time", "leakage", left=6_000.0)
    assert of(1e8, one, more).first.label == "friction + something unknown"
    assert of(1e8, one, law("backlash", left=6_000.0)).first.label == "something unknown"


def test_names_that_come_as_near_in_a_set_of_several_are_told_as_alternatives():
    found = of(1e8, law("friction", "leakage", left=5_000.0), law("backlash", "leakage", left=6_000.0))
    assert verdict(found) == "partly_explained"
    assert found.alternatives == (("friction", "backlash"),)
    assert found.chance("leakage") > 0.99


def test_table_a_cause_more_must_leave_a_quarter():
    one = law("friction", left=500.0)
    assert of(1e6, one, law("friction", "leakage", left=250.0)).first.label == "friction"
    assert of(1e6, one, law("friction", "leakage", left=20.0)).first.label == "friction + leakage"


def test_table_ambiguous_rows_are_within_the_odds():
    near, far = law("backlash", left=10.0), law("leakage", left=400.0)
    found = of(1e5, law("friction", left=0.0), near, far)
    assert [r.label for r in found.ambiguous] == ["friction", "backlash"]
    assert 0.5 < found.chance("friction") < 0.9
    assert sum(r.probability for r in found.rows) == pytest.approx(1.0)


def test_table_keeps_the_better_of_two_that_say_the_same():
    at_spool, at_pilot = law("friction", left=90.0), law("friction", left=0.0)
    rows = of(1e5, at_spool, at_pilot).rows
    assert [r.left for r in rows if r.label == "friction"] == [0.0]


def test_table_noise_is_the_least_chi2_within_what_is_known_of_it():
    noise = replace(NOISE, least=0.4, most=1.1)
    assert table(noise, [Hypothesis((), 0.1 * NOISE.count)]).chi2 == 0.4 * NOISE.count
    assert table(noise, [Hypothesis((), 0.7 * NOISE.count)]).chi2 == 0.7 * NOISE.count
    assert table(noise, [Hypothesis((), 9.0 * NOISE.count)]).chi2 == pytest.approx(1.1 * NOISE.count)


def test_as_dict_says_all_that_the_verdict_is_read_from():
    printed = of(1e5, law("friction", left=0.0)).as_dict(2)
    first = printed["rows"][0]
    assert (first["name"], first["causes"], first["unknowns"], first["left"]) == ("friction", 1, 2, 0.0)
    assert first["score"] == pytest.approx(score(NOISE, 0.0, 1, 2), abs=0.01)
    assert len(printed["rows"]) == 2
    assert printed["criteria"]["parts"] == 100.0


def test_verdict_what_a_gate_has_refuted_does_not_compete():
    weighed = of(100.0, law("friction", left=0.0))
    left = weighed.without("consistent")
    assert "nothing" not in {row.label for row in left.rows}
    assert left.first.label == "friction"
    assert sum(row.probability for row in left.rows) == pytest.approx(1.0)


def test_reader_finds_the_first_row_by_causes_and_what_is_left():
    def case(k):
        rng = np.random.default_rng(k)
        nothing = 10.0 ** rng.uniform(2.0, 6.0)
        shares = [rng.uniform(1 / 6, 1 / 2.7), 0.1] if k < 5 else 10.0 ** -rng.uniform(0.0, 4.0, 2)
        one = max((nothing + 100.0) * shares[0] - 100.0, 0.0)  # five within half as much again of the border
        laws = law("friction", left=one), law("friction", "leakage", left=one * shares[1])
        noise = replace(NOISE, most=1.0, names=int(rng.integers(20, 40)))
        rows = table(noise, [Hypothesis((), noise.count + nothing), *laws, exact]).as_dict(12)["rows"]
        seen = [(row["causes"], row["unknowns"], row["left"]) for row in rows]
        return seen.index(min(seen, key=lambda row: (row[2] + 100.0) * 4.0 ** row[0])) == 0

    exact = law("backlash", "dead_time", "asymmetry", left=0.0)
    assert sum(map(case, range(20))) >= 19
