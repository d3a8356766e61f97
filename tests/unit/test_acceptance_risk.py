"""The table of what the acceptance test risks, from verdicts that are known."""

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
from acceptance_risk import Judged, table


def test_risks_are_counted_and_stated():
    judged = [
        *[Judged("good", "pass", 0.9)] * 8,
        Judged("good", "fail", 0.4),
        Judged("good", "cannot tell", 0.8),
        Judged("malfunctioned", "pass", 0.8),
        *[Judged("severely malfunctioned", "fail", 0.0)] * 9,
    ]
    rows = dict(line.strip("| ").split(" | ") for line in list(table([("all", judged)]))[2:])
    assert rows["valves, good ones"] == "20, 10"
    assert rows["worn valves accepted"].startswith("1 of 10: ")
    assert rows["accepted valves that are worn"].startswith("1 of 9: ")
    assert float(rows["— as the certificates state"].split()[0]) == pytest.approx(100 * (8 * 0.1 + 0.2) / 9, abs=0.06)
    assert rows["good valves not accepted"] == "2 of 10: 5.7 … 51.0 %"
    assert float(rows["— as the certificates state it"].split()[0]) == pytest.approx(100 * 1.2 / 9.2, abs=0.06)
    assert rows["— of these, cannot tell"] == "1"


def test_a_study_that_was_stopped_at_once_still_has_its_table():
    assert "| good valves not accepted | — |" in list(table([("none", [])]))
