"""The acceptance test of an EFC that cannot be done in full: it ends early, says why, and leaves the outputs safe."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from efc_bench import STUCK, failed, outcome, value, valve

from hil.errors import SettingError
from hil.record.read import read_recording

# The population is drawn once, for all of them.
pytestmark = [pytest.mark.xdist_group("efc population"), pytest.mark.usefixtures("unprinted")]
SHORT = {"sweep_s": 8.0, "levels": ("medium",), "frequencies": (1.0, 3.0, 8.0)}


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
def test_what_ends_the_test_early(
    tmp_path: Path, changes: dict[str, Any], settings: dict[str, object], reason: str, highest_a: float
) -> None:
    made = outcome(tmp_path, "efc_acceptance", changes, **SHORT, **settings)
    found = made.findings
    assert (found.verdict, made.exit_status) == ("fail", 1)
    assert "parts_completed" in failed(found)
    assert any(note.startswith("Ended early") for note in found.notes)
    assert any(reason in note for note in found.notes)
    assert value(found, "probability_good") is None
    current = read_recording(tmp_path / "run").values("current")
    assert current[-1] == 0.0 and np.abs(current).max() <= highest_a + 1e-3


def test_a_valve_that_current_closes_passes_as_one(tmp_path: Path) -> None:
    found = outcome(tmp_path, "efc_acceptance", valve(normally_open=1), **SHORT, normally_open=True).findings
    assert not failed(found)
    assert value(found, "leakage") == pytest.approx(80.0, abs=4.0)


def test_a_level_that_the_valve_does_not_reach_is_left_out_and_said(tmp_path: Path) -> None:
    found = outcome(tmp_path, "efc_acceptance", valve(supply_pressure=140), **SHORT).findings
    assert "parts_completed" in failed(found)
    assert value(found, "parts_completed") == 5.0
    assert any(note.startswith("Level medium of the frequency response left out") for note in found.notes)


def test_a_top_current_that_does_not_open_the_valve_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match=r"top_current: 1\.5 A; it must be at least 1\.8"):
        outcome(tmp_path, "efc_acceptance", top_current=1.5)
