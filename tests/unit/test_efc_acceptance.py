"""The acceptance test of an EFC on its bench: a good valve passes, a worn one fails with its class.

One that cannot be tested in full ends early, says why, and leaves the outputs safe.
"""

import json

import numpy as np
import pytest
from efc_bench import STUCK, failed, friction, outcome, value, valve
from handed_on import check_handed_on

from hil.errors import SettingError
from hil.record.read import read_recording

# The population is drawn once, for all of them.
pytestmark = [pytest.mark.xdist_group("efc population"), pytest.mark.usefixtures("unprinted")]
SHORT = {"sweep_s": 8.0, "levels": ("medium",), "frequencies": (1.0, 3.0, 5.0, 8.0)}


def test_a_good_valve_passes_the_whole_sequence(tmp_path):
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


def test_a_worn_valve_that_leaks_fails_with_its_class(tmp_path):
    worn = valve(friction(0.004), rotor_frequency=25.0, rotor_damping=1.05, leakage=140)
    made = outcome(tmp_path, "efc_acceptance", worn, **SHORT)
    assert made.exit_status == 1
    assert failed(made.findings) >= {"probability_good", "usual_among_good", "rise_over_good", "leakage"}
    assert (value(made.findings, "probability_severe") or 0.0) > 80.0
    assert any(note.startswith("Condition: severely malfunctioned") for note in made.findings.notes)
    assert made.findings.population is not None
    assert {"leakage", "rise"} <= {m.name for m in made.findings.population.those("fail")}
    assert "this one differs in" in made.report.read_text(encoding="utf-8")


def test_a_valve_unlike_every_class_is_called_so_and_not_accepted(tmp_path):
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


@pytest.mark.parametrize(
    ("changes", "settings", "reason", "highest_a"),
    [
        (valve(resistance=0.05, inductance=0.001), {}, "shorted", 0.5),
        (valve(resistance=1e5), {}, "open", 0.5),
        (valve(resistance=7.2), {}, "that of a 24 V coil", 0.5),
        (valve(normally_open=1), {}, "as the valve's type asks", 1.8),
        ({}, {"normally_open": True}, "as the valve's type asks", 1.8),
        (STUCK, {}, "does not follow", 1.8),
    ],
    ids=("short", "open", "24 V", "normally open", "normally closed", "stuck sensor"),
)
def test_what_ends_the_test_early(tmp_path, changes, settings, reason, highest_a):
    made = outcome(tmp_path, "efc_acceptance", changes, **SHORT, **settings)
    found = made.findings
    assert (found.verdict, made.exit_status) == ("fail", 1)
    assert "parts_completed" in failed(found)
    assert any(note.startswith("Ended early") for note in found.notes)
    assert any(reason in note for note in found.notes)
    assert value(found, "probability_good") is None
    current = read_recording(tmp_path / "run").values("current")
    assert current[-1] == 0.0 and np.abs(current).max() <= highest_a + 1e-3


def test_a_valve_that_current_closes_passes_as_one(tmp_path):
    found = outcome(tmp_path, "efc_acceptance", valve(normally_open=1), **SHORT, normally_open=True).findings
    assert not failed(found)
    assert value(found, "leakage") == pytest.approx(80.0, abs=4.0)


def test_a_level_that_the_valve_does_not_reach_is_left_out_and_said(tmp_path):
    found = outcome(tmp_path, "efc_acceptance", valve(supply_pressure=140), **SHORT).findings
    assert "parts_completed" in failed(found)
    assert value(found, "parts_completed") == 5.0
    assert any(note.startswith("Level medium of the frequency response left out") for note in found.notes)


def test_a_top_current_that_does_not_open_the_valve_is_refused(tmp_path):
    with pytest.raises(SettingError, match=r"top_current: 1\.5 A; it must be at least 1\.8"):
        outcome(tmp_path, "efc_acceptance", top_current=1.5)
