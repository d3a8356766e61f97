"""Scoring: each thing that can be said is judged; a score can fail."""

from __future__ import annotations

import numpy as np
import pytest

from tests.studies.proof.cases.label import Label
from tests.studies.proof.cases.truth import Truth
from tests.studies.proof.score.bar import claims
from tests.studies.proof.score.calibration import brier
from tests.studies.proof.score.coverage import intervals
from tests.studies.proof.score.gap import fit_percent, gap_closed, misfit_sigma
from tests.studies.proof.score.judge import judge
from tests.studies.proof.score.result import Result, judged
from tests.studies.proof.score.table import HEADINGS, cells, sections
from tests.studies.proof.truth.law import Hidden
from tests.studies.proof.truth.noise import WHITE
from tests.studies.rates import Rate

FRICTION = Hidden("friction_lugre", (2.0, 1.3, 8.0, 0.1, 0.0))
DELAY = Hidden("dead_time_pure", (0.020, 1.0))
LAG = Hidden("sensor_lag_second_order", (0.02, 0.7))
THREE = ("friction", "dead_time", "sensor_lag")
BURR = Hidden("odd_gain_bump", (0.2, 50.0, 6.0))


def truth(kind: str, *hidden: Hidden, changed: dict[str, float] | None = None, sigma: float = 4.0) -> Truth:
    unit = {"pilot": 8.0, "spool_frequency": 33.0, "spool_damping": 0.5, "full_flow": 70.0, "curve_exponent": 1.2}
    shown = tuple(sigma for _ in hidden) or ((sigma,) if changed else (0.0,))
    return Truth(
        Label(kind, "brevini-hpv41", "full", 0), 1, unit, unit | (changed or {}), hidden, WHITE, 100, False,
        shown, tuple(sigma for _ in hidden), "salt",
    )  # fmt: skip


def says(verdict: str, *names: str, parameters: dict | None = None, changed: list | None = None) -> dict:
    effects = [{"name": name, "probability": 0.9, "parameters": parameters or {}} for name in names]
    return {"verdict": verdict, "effects": effects, "changed_parameters": changed or []}


@pytest.mark.parametrize(
    ("hidden", "diagnosis", "said", "right"),
    [
        (truth("friction", FRICTION), says("explained", "friction"), "named first", True),
        (truth("friction", FRICTION), says("explained", "backlash", "friction"), "named, not first", False),
        (truth("friction", FRICTION), says("explained", "backlash"), "wrong name", False),
        (truth("friction", FRICTION), says("unexplained"), "unexplained", False),
        (truth("friction", FRICTION), says("parameter_change"), "parameter change", False),
        (truth("friction", FRICTION), says("consistent"), "consistent", False),
        (truth("pair", FRICTION, DELAY), says("explained", "dead_time", "friction"), "both named", True),
        (truth("pair", FRICTION, DELAY), says("explained", "dead_time", "leakage"), "one of two named", False),
        (truth("pair", FRICTION, DELAY), says("explained", "leakage"), "wrong name", False),
        (truth("three", FRICTION, DELAY, LAG), says("explained", *THREE), "all three named", True),
        (truth("three", FRICTION, DELAY, LAG), says("explained", *THREE[:2]), "one or two of three named", False),
        (truth("gain_bump", BURR), says("unexplained"), "unexplained", True),
        (truth("gain_bump", BURR), says("partly_explained", "saturation"), "wrong name", False),
        (truth("gain_bump", BURR), says("parameter_change"), "parameter change", False),
        (truth("none"), says("consistent"), "consistent", True),
        (truth("none"), says("unexplained"), "unexplained", False),
        (truth("none"), says("explained", "sensor_drift"), "wrong name", False),
        (truth("parameter_change", changed={"pilot": 9.0}), says("parameter_change"), "parameter change", True),
        (truth("parameter_change", changed={"pilot": 9.0}), says("consistent"), "consistent", False),
        (truth("parameter_change", changed={"pilot": 9.0}), says("explained", "coil_lag"), "wrong name", False),
    ],
)
def test_every_answer_is_judged(hidden, diagnosis, said, right):
    found = judge(hidden, diagnosis)
    assert (found.said, found.right) == (said, right)


def test_names_too_many_are_counted_beside_a_right_one():
    assert judge(truth("friction", FRICTION), says("explained", "friction", "leakage")).surplus == 1


def test_a_fit_is_the_papers_fit():
    measured = np.array([0.0, 1.0, 2.0, 3.0])
    assert fit_percent(measured, measured) == 100.0
    assert fit_percent(measured, np.full(4, 1.5)) == pytest.approx(0.0)


def test_the_gap_is_that_between_nominal_model_and_truth():
    assert gap_closed(nominal=80.0, corrected=95.0, truth=99.0) == pytest.approx(15 / 19)
    assert gap_closed(nominal=80.0, corrected=70.0, truth=99.0) < 0
    assert misfit_sigma(np.zeros(4), np.full(4, 0.6), 0.3) == pytest.approx(2.0)


def test_an_interval_counts_where_the_unit_tells_which_parameter_is_meant():
    hidden = truth("dead_time", DELAY)
    right = {"a": {"value": 0.0201, "std": 1e-4, "unit": "s"}, "b": {"value": 1.0, "std": 1.0, "unit": "1"}}
    assert [i.holds for i in intervals(hidden, says("explained", "dead_time", parameters=right))] == [True]
    wrong = {"a": {"value": 0.0201, "std": 1e-5, "unit": "s"}}
    assert [i.holds for i in intervals(hidden, says("explained", "dead_time", parameters=wrong))] == [False]
    two = {"a": {"value": 0.02, "std": 1e-4, "unit": "s"}, "b": {"value": 0.02, "std": 1e-4, "unit": "s"}}
    assert intervals(hidden, says("explained", "dead_time", parameters=two)) == []
    assert intervals(hidden, says("explained", "friction", parameters=right)) == []


@pytest.mark.parametrize(("lower", "holds"), [(-89.1, True), (-89.0, False), (89.0, False)])
def test_a_stop_on_either_side_is_where_it_was_met(lower, holds):
    hidden = truth("end_stop", Hidden("end_stop_contact", (11.9, 101.0, 300.0, 0.002)))
    said = {"upper": {"value": 130.0, "std": None, "unit": "%"}, "lower": {"value": lower, "std": 0.02, "unit": "%"}}
    assert [i.holds for i in intervals(hidden, says("explained", "end_stop", parameters=said))] == [holds]


def test_an_interval_of_a_changed_parameter_is_compared_by_name():
    changed = [{"name": "pilot_rate", "from": 8.0, "to": 9.1, "std": 0.1, "unit": "rad/s"}]
    found = intervals(
        truth("parameter_change", changed={"pilot": 9.0}), says("parameter_change", changed=changed)
    )  # fmt: skip
    assert [(i.true, i.holds) for i in found] == [(9.0, True)]


def test_rates_carry_exact_intervals():
    low, high = Rate(0, 300).interval()
    assert low == 0.0
    assert high == pytest.approx(1 - 0.025 ** (1 / 300))
    assert str(Rate(9, 10)) == "90 % [55…100]"
    assert str(Rate(0, 0)) == "–"


def scored(hidden: Truth, diagnosis: dict, **more: object) -> Result:
    return judged(hidden, judge(hidden, diagnosis), **more)


def population(answers: dict[str, dict]) -> list[Result]:
    cases = [
        truth("friction", FRICTION), truth("dead_time", DELAY), truth("pair", FRICTION, DELAY),
        truth("gain_bump", BURR), truth("none"), truth("parameter_change", changed={"pilot": 9.0}),
    ]  # fmt: skip
    return [scored(case, answers[case.label.kind], closed=0.98, seconds={"diagnose": 3.0}) for case in cases]


PERFECT = {
    "friction": says("explained", "friction"),
    "dead_time": says("explained", "dead_time"),
    "pair": says("explained", "friction", "dead_time"),
    "gain_bump": says("unexplained"),
    "none": says("consistent"),
    "parameter_change": says("parameter_change"),
}


def test_a_perfect_diagnoser_reaches_the_bar():
    found = claims(population(PERFECT))
    assert {claim.met for claim in found} == {True, None}  # None: no intervals were given
    assert found[0].found == "100 % [16…100]"


def test_one_that_always_names_the_wrong_effect_misses_it():
    missed = {
        c.what for c in claims(population({kind: says("explained", "leakage") for kind in PERFECT})) if c.met is False
    }
    assert missed == {
        "effect named first, full severity", "wrong names, full severity", "false alarms where nothing is concealed",
        "out of library called unexplained", "pairs, both named", "parameter changes called so", "Brier score of names",
    }  # fmt: skip


def test_one_that_never_dares_to_name_is_right_only_where_no_name_exists():
    found = {c.what: c.met for c in claims(population({kind: says("unexplained") for kind in PERFECT}))}
    assert found["out of library called unexplained"] is True
    assert found["wrong names, full severity"] is True
    assert found["effect named first, full severity"] is False
    assert found["false alarms where nothing is concealed"] is False


def test_a_name_said_with_nine_in_ten_costs_a_hundredth_where_right_and_eighty_one_where_wrong():
    right, wrong = (scored(truth("friction", FRICTION), says("explained", name)) for name in ("friction", "leakage"))
    assert brier([right, wrong]) == pytest.approx((0.01 + 0.81) / 2)


def test_what_hardly_shows_is_tabulated_but_not_scored():
    faint = scored(truth("friction", FRICTION, sigma=0.05), says("consistent"))
    assert not faint.visible
    row = sections([faint])[0].rows[0]
    assert (len(row.scored), row.faint) == (0, 1)
    assert claims([faint])[0].met is None


def test_every_row_of_the_table_has_a_cell_for_each_heading():
    for section in sections(population(PERFECT)):
        for row in section.rows:
            assert len(cells(row)) == len(HEADINGS)
