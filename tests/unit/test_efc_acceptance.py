"""The acceptance test of an EFC on its bench: a good valve passes, a worn one fails with its class."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from efc_bench import failed, friction, outcome, value, valve
from handed_on import check_handed_on

from hil.record.read import read_recording

# The population is drawn once, for all of them.
pytestmark = [pytest.mark.xdist_group("efc population"), pytest.mark.usefixtures("unprinted")]
SHORT = {"sweep_s": 10.0, "levels": ("medium",), "frequencies": (1.0, 3.0, 8.0)}


def test_a_good_valve_passes_the_whole_sequence(tmp_path: Path) -> None:
    made = outcome(tmp_path, "efc_acceptance", **SHORT)
    found = made.findings
    assert (found.verdict, made.exit_status) == ("pass", 0)
    assert value(found, "parts_completed") == 6.0
    assert (value(found, "probability_good") or 0.0) > 80.0
    assert any(note.startswith("Condition: good") for note in found.notes)
    assert any("burst above 400 psi; 48 h at 133 % of the coil's voltage" in note for note in found.notes)
    assert {"flow_curve", "steps", "responses"} <= set(found.curves)
    # 1 mA of friction makes a loop of twice that
    assert value(found, "hysteresis") == pytest.approx(2.0, abs=0.6)
    assert json.loads((tmp_path / "run" / "results.json").read_text(encoding="utf-8"))["verdict"] == "pass"
    run = read_recording(tmp_path / "run")
    check_handed_on(made, tmp_path)
    assert run.values("current")[-1] == 0.0
    assert run.values("current").max() <= 2.0 and run.values("pressure").max() < 280.0


def test_a_worn_valve_that_leaks_fails_with_its_class(tmp_path: Path) -> None:
    worn = valve(friction(0.004), rotor_frequency=25.0, rotor_damping=1.05, leakage=140)
    made = outcome(tmp_path, "efc_acceptance", worn, **SHORT)
    assert made.exit_status == 1
    assert failed(made.findings) >= {"probability_good", "usual_among_good", "rise_over_good", "leakage"}
    assert (value(made.findings, "probability_severe") or 0.0) > 80.0
    assert any(note.startswith("Condition: severely malfunctioned") for note in made.findings.notes)
    assert made.findings.population is not None
    assert {"leakage", "rise"} <= {m.name for m in made.findings.population.those("fail")}
    assert "this one differs in" in made.report.read_text(encoding="utf-8")


def test_a_valve_unlike_every_class_is_called_so_and_not_accepted(tmp_path: Path) -> None:
    sticks = valve(friction(0.06), rotor_damping=1.3)  # a fast rotor that sticks
    made = outcome(tmp_path, "efc_acceptance", sticks, **SHORT)
    assert made.exit_status == 1
    assert any(note.startswith("Condition: unlike every class") for note in made.findings.notes)
    assert value(made.findings, "probability_good") is None
    assert "usual_among_good" in failed(made.findings)


def test_the_class_of_the_thesis_says_what_was_assumed():
    from hil.session.analyses import thesis_class

    found = thesis_class(1.2, "low", 1.0, 1000.0)
    assert (found.crisp, round(found.rms, 4)) == ("malfunctioned", 0.0379)
    assert found.memberships == pytest.approx(
        {"left trapezoid": 0.0, "left triangle": 0.0, "right triangle": 0.5, "right trapezoid": 0.0}
    )
    assert found.levels == pytest.approx({"low": 1.0, "high": 0.0})
    assert "over 1 s at 1000 Hz, where 0.049 psi rms are already called severely malfunctioned" in found.sentence
    assert "no fuzzy class" in found.sentence
