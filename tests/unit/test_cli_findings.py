"""The table on the terminal rounds as the report does."""

from __future__ import annotations

import pytest

from hil.cli.findings import findings_text
from hil.record.measurement import Findings, Measurement

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
def test_a_value(value: float | None, std: float | None, shown: str) -> None:
    assert findings_text(Findings((LAG.of(value, std),))) == f"lag  {shown}  s"


def test_a_row_with_limits_and_verdict() -> None:
    beyond = Measurement("bandwidth", "Hz", "", low=-5.0).of(20.0, 0.1, relation=">")
    text = findings_text(Findings((beyond,), notes=("a note",), deviations=("no filter",)))
    assert text.splitlines() == [
        "bandwidth  > 20.00 ± 0.20  Hz  ≥ -5  pass", "note: a note", "deviation: no filter", "verdict: pass"
    ]  # fmt: skip


def test_what_is_left_without_the_calibration_stands_beside() -> None:
    text = findings_text(Findings((LAG.of(50.0, 0.03, calibration=0.4),)))
    assert text == "lag  50.00 ± 0.80  s      (repeatability ± 0.060)"
