"""The table on the terminal rounds as the report does."""

import pytest

from hil.record.measurement import Findings, Measurement
from hil.report.terminal import findings_text

LAG = Measurement("lag", "s", "of the response")


@pytest.mark.parametrize(
    ("value", "std", "shown"),
    [
        (1.26912, 0.0061, "1.269 ± 0.012"),
        (-0.0012, 0.05, "0.00 ± 0.10"),
        (-1.5, 0.25, "-1.50 ± 0.50"),
        (1.0, 0.0498, "1.00 ± 0.10"),
        (1234.0, 60.0, "1230 ± 120"),
        (12345.0, 0.0, "12345"),
        (None, None, "not determined"),
    ],
)
def test_a_value(value, std, shown):
    assert findings_text(Findings((LAG.of(value, std),))).splitlines() == [
        f"lag  {shown}  s", "verdict: none; no limit was given, nothing was judged"
    ]  # fmt: skip


def test_a_row_with_limits_and_verdict():
    beyond = Measurement("bandwidth", "Hz", "", low=-5.0).of(20.0, 0.1, relation=">")
    text = findings_text(Findings((beyond,), notes=("a note",), deviations=("no filter",)))
    assert text.splitlines() == [
        "bandwidth  > 20.00 ± 0.20  Hz  ≥ -5  pass", "note: a note", "deviation: no filter", "verdict: pass"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("value", "std", "relation", "says"),
    [
        (5.1, 0.1, "=", "Cannot tell: lag is 5.10 ± 0.20 s, {}: it is missed by 0.1 s, but the uncertainty is 0.2 s."),
        (4.9, 0.1, "=", "Cannot tell: lag is 4.90 ± 0.20 s, {}: it is met by 0.1 s, but the uncertainty is 0.2 s."),
        (0.5, 0.1, "=", ("Fail: lag is 0.50 ± 0.20 s, {}: it is missed by 0.5 s, and the uncertainty is 0.2 s. "
                         "2.3 % of tests on this bench would fail a unit exactly at the limit.")),
        (7.0, 0.0, "=", "Fail: lag is 7 s, {}: it is missed by 2 s."),
        (4.0, None, "=", "Cannot tell: lag is 4 s, {}: it is met by 1 s, but the uncertainty is not known."),
        (4.0, 0.0, ">", "Cannot tell: lag is > 4 s, {}: a bound, the value itself may lie anywhere beyond it."),
        (5.0, 0.0, ">", "Fail: lag is > 5 s, {}."),
        (None, None, "=", "Cannot tell: lag is not determined, {}."),
    ],
)  # fmt: skip
def test_what_is_not_proven_is_said_with_how_far_it_is(value, std, relation, says):
    found = Findings((Measurement("lag", "s", "", 1.0, 5.0).of(value, std, relation=relation),))
    assert findings_text(found).splitlines()[-2:] == [says.format("limit 1 … 5 s"), f"verdict: {found.verdict}"]


def test_what_is_left_without_the_calibration_stands_beside():
    text = findings_text(Findings((LAG.of(50.0, 0.03, calibration=0.4),)))
    assert text.splitlines()[0] == "lag  50.00 ± 0.80  s      (repeatability ± 0.060)"
