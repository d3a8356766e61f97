"""Proof pressure: what was held, and the leakage after it against that before."""

from __future__ import annotations

import numpy as np
import pytest
from swept_recording import swept_recording

from procedures.proof_pressure import KIND, evaluate

LABELS = ("before", "held", "held", "after")


def found(leakage: tuple[float, ...], supply: tuple[float, ...], seed: int = 0) -> dict:
    channels = {
        "return flow": ("l/min", lambda command, k: np.full(len(command), leakage[k]), 0.02),
        "supply pressure": ("bar", lambda command, k: np.full(len(command), supply[k]), 0.2),
    }
    stations = [(0.0, 0.0, 20.0), (100.0, 100.0, 20.0), (-100.0, -100.0, 20.0), (0.0, 0.0, 20.0)]
    recording = swept_recording(KIND, stations, channels, [{"label": label} for label in LABELS], seed)
    return {one.name: one for one in evaluate(recording).measured}


@pytest.mark.parametrize("grown", [0.0, 0.1])
def test_what_the_valve_leaks_more_afterwards_is_held_by_its_interval(grown):
    for seed in range(5):
        one = found((0.4, 0.2, 0.2, 0.4 + grown), (70.0, 91.5, 91.0, 70.0), seed)
        assert one["leakage_change"].value == pytest.approx(grown, abs=3.5 * one["leakage_change"].std)
        assert one["leakage_change"].std < 0.002
        assert one["leakage_before"].value == pytest.approx(0.4, abs=3.5 * one["leakage_before"].std)
        assert one["proof_pressure"].value == pytest.approx(91.0, abs=0.1)  # the end that had less
