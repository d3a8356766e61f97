"""The acceptance test of an EFC on its bench: a good valve, worn ones, and what must end it early and say why."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from hil.bench.find import benches
from hil.bench.read import read_bench
from hil.record.measurement import Findings
from hil.record.read import read_recording
from hil.session.procedure import load_procedure
from hil.session.run import run_procedure

BENCH = benches()["cummins-efc-acceptance"].read_text(encoding="utf-8")
FRICTION = "coulomb = 0.004"
WORLD = "[simulation]\nseed = 1\n"
SHORT = {"sweep_s": 10.0, "levels": ("medium",), "frequencies": (1.0, 3.0, 8.0)}


def certificate(tmp_path: Path, changes: dict[str, str] | None = None, **settings: object) -> Findings:
    text = BENCH
    for old, new in (changes or {}).items():
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "bench.toml"
    path.write_text(text, encoding="utf-8")
    outcome = run_procedure(load_procedure("efc_acceptance"), read_bench(path), {**SHORT, **settings}, tmp_path / "run")
    assert outcome.exit_status == (1 if outcome.findings.verdict == "fail" else 0)
    return outcome.findings


def with_(parameters: str) -> dict[str, str]:
    return {WORLD: f"{WORLD}parameters = {{ {parameters} }}\n"}


def value(findings: Findings, name: str) -> float | None:
    (found,) = (m for m in findings.measured if m.name == name)
    return found.value


def failed(findings: Findings) -> set[str]:
    return {m.name for m in findings.measured if m.verdict == "fail"}


def test_a_good_valve_passes_the_whole_sequence(tmp_path: Path) -> None:
    found = certificate(tmp_path)
    assert found.verdict == "pass"
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
    worn = {FRICTION: "coulomb = 0.045", **with_("rotor_damping = 5.4, leakage = 140")}
    found = certificate(tmp_path, worn)
    assert failed(found) == {"probability_good", "leakage"}
    assert (value(found, "probability_severe") or 0.0) > 80.0
    assert any("severely malfunctioned" in note for note in found.notes)


@pytest.mark.parametrize(
    ("changes", "settings", "reason", "highest_a"),
    [
        (with_("resistance = 0.05, inductance = 0.001"), {}, "shorted", 0.5),
        (with_("resistance = 1e5"), {}, "open", 0.5),
        (with_("normally_open = 1"), {}, "as the valve's type asks", 1.8),
        ({}, {"normally_open": True}, "as the valve's type asks", 1.8),
        ({"pressure = { noise = 0.5 }": "pressure = { value = 60.0, noise = 0.01 }"}, {}, "does not follow", 1.8),
    ],
)
def test_what_ends_the_test_early(
    tmp_path: Path, changes: dict[str, str], settings: dict[str, object], reason: str, highest_a: float
) -> None:
    found = certificate(tmp_path, changes, **settings)
    assert found.verdict == "fail"
    assert "parts_completed" in failed(found)
    assert any(note.startswith("Ended early") for note in found.notes)
    assert any(reason in note for note in found.notes)
    assert value(found, "probability_good") is None
    current = read_recording(tmp_path / "run").values("current")
    assert current[-1] == 0.0 and np.abs(current).max() <= highest_a + 1e-3


def test_a_valve_that_current_closes_passes_as_one(tmp_path: Path) -> None:
    found = certificate(tmp_path, with_("normally_open = 1"), normally_open=True)
    assert not failed(found)
    assert value(found, "leakage") == pytest.approx(80.0, abs=4.0)
