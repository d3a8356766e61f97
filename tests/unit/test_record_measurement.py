"""Declared measurements and what may be said about a limit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.record.measurement import Findings, Measured, Measurement, is_accepted, judge

BANDWIDTH = Measurement("bandwidth", "Hz", "frequency of −3 dB", low=3.0)


@pytest.mark.parametrize(
    ("value", "std", "low", "high", "verdict"),
    [
        (3.5, 0.1, 3.0, None, "pass"),
        (3.2, 0.1, 3.0, None, "pass"),  # 3.2 − 2·0.1 just reaches the limit, which is allowed
        (3.1, 0.1, 3.0, None, "cannot tell"),
        (2.9, 0.1, 3.0, None, "cannot tell"),
        (2.7, 0.1, 3.0, None, "fail"),
        (5.0, 0.0, 0.0, 5.0, "pass"),
        (5.1, 0.0, 0.0, 5.0, "fail"),
        (2.5, 2.0, 0.0, 5.0, "cannot tell"),  # less certain than the limits are apart
        (3.5, None, 3.0, None, "cannot tell"),  # nobody knows how well it is known
        (None, None, 3.0, None, "cannot tell"),
        (float("nan"), 0.1, 3.0, None, "cannot tell"),
        (3.5, 0.1, None, None, None),
    ],
)
def test_the_guard_band_decides(value, std, low, high, verdict):
    assert judge(value, std, low, high) == verdict


@pytest.mark.parametrize("low", [None, 7.9], ids=["one limit", "two limits closer than the uncertainty"])
@pytest.mark.parametrize("unit", [8.0, 8.6])
def test_a_probability_of_fail_is_what_a_thousand_runs_show(unit, low):
    current = Measurement("current", "A", "", low=low, high=8.0)
    fails = 0
    for reading in np.random.default_rng(1).normal(unit, 0.3, 1000):
        fails += current.of(reading, 0.18, calibration=0.24).verdict == "fail"
    expected = current.of(9.0, 0.18, calibration=0.24).fail_probability(unit, 0.3)
    assert fails == pytest.approx(1000.0 * expected, abs=3.5 * np.sqrt(1000.0 * expected * (1.0 - expected)))


def test_a_unit_at_the_limit_seldom_fails():
    assert BANDWIDTH.of(2.0, 0.1).fail_probability_at_limit == pytest.approx(0.02275, rel=1e-3)
    assert BANDWIDTH.of(2.0, 0.0).fail_probability_at_limit is None
    assert BANDWIDTH.of(2.0, 0.1, relation="<").fail_probability_at_limit is None
    assert BANDWIDTH.of(None).fail_probability_at_limit is None


def test_a_value_beyond_the_test_can_still_be_judged():
    assert BANDWIDTH.of(4.9, 0.0, relation=">").verdict == "pass"
    assert BANDWIDTH.of(2.0, 0.0, relation=">").verdict == "cannot tell"
    assert BANDWIDTH.of(2.0, 0.1, relation="<").verdict == "fail"
    assert Measurement("lag", "ms", "", high=10.0).of(4.9, 0.0, relation=">").verdict == "cannot tell"
    assert BANDWIDTH.of(3.0, 0.0, relation="<").verdict == "fail"  # below 3 is not 3


def test_a_size_that_its_uncertainty_covers_is_a_bound():
    distortion = Measurement("thd", "%", "")
    assert distortion.size(5.0, 0.5) == distortion.of(5.0, 0.5)
    assert distortion.size(5.0, 3.0) == distortion.of(11.0, 0.0, relation="<")


def test_a_declared_limit_that_nothing_was_found_for_cannot_be_told():
    declared = (BANDWIDTH, Measurement("lag", "ms", "without a limit"))
    assert Findings().with_missing(declared).verdict == "cannot tell"
    assert [m.name for m in Findings().with_missing(declared).measured] == ["bandwidth"]
    some = Findings((BANDWIDTH.at("+50 %").of(4.0, 0.1),))
    assert some.with_missing(declared) == some


@pytest.mark.parametrize(
    ("verdict", "accepted"), [("pass", True), (None, True), ("fail", False), ("cannot tell", False)]
)
def test_only_what_is_proven_or_not_judged_is_accepted(verdict, accepted):
    assert is_accepted(verdict) is accepted


@given(st.floats(-10, 10), st.floats(0, 3), st.floats(-10, 0), st.floats(0, 10))
def test_less_uncertainty_never_turns_a_verdict_around(value, std, low, high):
    before, after = judge(value, std, low, high), judge(value, std / 2.0, low, high)
    assert after == before or before == "cannot tell"


def test_what_was_found_keeps_what_was_declared():
    found = BANDWIDTH.of(4.0, 0.1)
    assert found == Measured("bandwidth", 4.0, "Hz", 0.1, 3.0, None, "pass", "=", "frequency of −3 dB")


@pytest.mark.parametrize(
    ("verdicts", "whole"),
    [((), None), ((None,), None), (("pass", None), "pass"), (("pass", "cannot tell"), "cannot tell"),
     (("cannot tell", "fail", "pass"), "fail")],
)  # fmt: skip
def test_the_worst_verdict_is_that_of_the_run(verdicts, whole):
    assert Findings(tuple(Measured("x", 1.0, "1", verdict=verdict) for verdict in verdicts)).verdict == whole


def test_the_verdict_uses_the_whole_uncertainty_and_repeatability_is_what_is_left_of_it():
    found = Measurement("gain", "1", "", low=0.95).of(1.0, 0.003, calibration=0.04)
    assert found.std == pytest.approx(np.hypot(0.003, 0.04))
    assert found.repeatability == pytest.approx(0.003)
    assert found.verdict == "cannot tell"
    assert Measurement("gain", "1", "", low=0.95).of(1.0, 0.003).verdict == "pass"
