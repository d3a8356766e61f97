"""The acceptance test of an EFC on its bench: a good valve passes, a worn one fails with its class."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from efc_bench import failed, friction, outcome, value, valve

from hil.record.read import read_recording

SHORT = {"sweep_s": 10.0, "levels": ("medium",), "frequencies": (1.0, 3.0, 8.0)}


def test_a_good_valve_passes_the_whole_sequence(tmp_path: Path) -> None:
    made = outcome(tmp_path, "efc_acceptance", **SHORT)
    found = made.findings
    assert (found.verdict, made.exit_status) == ("pass", 0)
    assert value(found, "parts_completed") == 6.0
    assert (value(found, "probability_good") or 0.0) > 80.0
    assert any(note.startswith("Condition: good") for note in found.notes)
    assert {"flow_curve", "steps", "responses"} <= set(found.curves)
    # 4 mA of friction make a loop of twice that, and a bit for stiction
    assert value(found, "hysteresis") == pytest.approx(9.0, abs=1.5)
    assert json.loads((tmp_path / "run" / "findings.json").read_text(encoding="utf-8"))["verdict"] == "pass"
    run = read_recording(tmp_path / "run")
    assert run.values("current")[-1] == 0.0
    assert run.values("current").max() <= 2.0 and run.values("pressure").max() < 280.0


def test_a_worn_valve_that_leaks_fails_with_its_class(tmp_path: Path) -> None:
    worn = valve("rotor_damping = 5.4, leakage = 140", friction(0.045))
    made = outcome(tmp_path, "efc_acceptance", worn, **SHORT)
    assert made.exit_status == 1
    assert failed(made.findings) == {"probability_good", "leakage"}
    assert (value(made.findings, "probability_severe") or 0.0) > 80.0
    assert any("severely malfunctioned" in note for note in made.findings.notes)
