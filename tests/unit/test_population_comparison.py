"""A valve beside good ones: what differs and by how much, what does not, what cannot be told; never the verdict."""

from dataclasses import replace

from hil.findings.collect import findings_of, results_of
from hil.identification.papers.efc_condition import GoodRange, GoodRanges, ValveTest
from hil.record.measurement import Findings, Measurement
from hil.record.population_comparison import PopulationComparison
from hil.report.comparisons import comparison_sentences
from hil.report.results import verdict_box
from procedures.efc_acceptance import beside_good as against_good
from tests.unit.test_report_run import a_recording

GOOD = GoodRanges(
    {"friction": GoodRange(0.002, 0.005, 0.012), "rise": GoodRange(0.04, 0.05, 0.0625),
     "leakage": GoodRange(60.0, 75.0, 94.0), "bandwidth": GoodRange(4.0, 6.0, 9.0)}, 240,
)  # fmt: skip
TEST = ValveTest(0.020, 0.0622, 70.0, 3.0, rise_std_s=0.001, bandwidth_std_hz=0.1, friction_std_a=0.001)
MISSED = Measurement("leakage", "ml/min", "", high=60.0).of(70.0, 1.0)
COMPARED = against_good(TEST, 1.0, GOOD)


def test_every_figure_stands_in_its_own_part_of_the_sentence():
    said, rests = comparison_sentences(Findings((MISSED,), population=COMPARED))
    differs, like, either = said.split("; ")
    assert "friction 20.0 ± 2.0 mA (good 2 … 12 mA: above by 8 mA)" in differs
    assert "bandwidth 3 dB 3.00 ± 0.20 Hz (good 4 … 9 Hz: below by 1 Hz)" in differs
    assert like == "is like them in leakage 70.0 ± 2.0 ml/min (good 60 … 94 ml/min)"
    assert "rise 62.2 ± 2.0 ms" in either
    assert "240 simulated good units" in rests and "2.5 %" in rests


def test_an_unknown_uncertainty_can_tell_nothing():
    found = against_good(TEST, None, GOOD)
    assert [m.name for m in found.those("cannot tell")] == ["leakage", "rise"]


def test_it_is_silent_after_a_pass_and_leaves_every_verdict_as_it_is():
    for missed in (MISSED, replace(MISSED, verdict="pass"), replace(MISSED, verdict="cannot tell")):
        plain, beside = Findings((missed,)), Findings((missed,), population=COMPARED)
        assert plain.verdict == beside.verdict and plain.open_or_missed == beside.open_or_missed
        assert bool(verdict_box(beside, {})["beside"]) == (missed.verdict != "pass")
    assert verdict_box(Findings((MISSED,)), {})["beside"] == []


def test_what_cannot_be_said_is_one_sentence():
    (said,) = comparison_sentences(Findings((MISSED,), population=PopulationComparison(reason="not measured: steps")))
    assert said == "What differs from good units of its type is not known: not measured: steps."


def test_it_is_handed_on_whole_with_the_results():
    found = Findings((MISSED,), population=COMPARED)
    assert findings_of(results_of(a_recording(), found)).population == COMPARED
    assert findings_of(results_of(a_recording(), Findings((MISSED,)))).population is None
