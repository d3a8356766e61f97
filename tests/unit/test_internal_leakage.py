"""Internal leakage of return flows by formula."""

import numpy as np
import pytest
from swept_recording import swept_recording

from procedures.internal_leakage import KIND, evaluate


def found(dip=0.0, null=0.8, seed=0, half=False):
    """A peak of 0.3 l/min on 0.2 l/min, with a dip in its middle where edges overlap."""

    def leak(command, _k):
        place = np.abs(command - null)
        return 0.2 + 0.3 / (1.0 + (place / 2.0) ** 2) - dip * np.exp(-((place / 0.6) ** 2))

    sweeps = [(-100.0, 100.0, 60.0), (-10.0, 10.0, 60.0)][: 1 if half else 2]
    findings = evaluate(swept_recording(KIND, sweeps, {"return flow": ("l/min", leak, 0.02)}, seed=seed))
    return findings, {one.name: one for one in findings.measured}


@pytest.mark.parametrize("dip", [0.0, 0.1])
def test_the_peak_and_its_middle_hold_the_truth_though_edges_overlap(dip):
    fine = np.linspace(-10.0, 10.0, 100_001)
    place = np.abs(fine - 0.8)
    truth = (0.2 + 0.3 / (1.0 + (place / 2.0) ** 2) - dip * np.exp(-((place / 0.6) ** 2))).max()
    for seed in range(3):
        _, one = found(dip=dip, seed=seed)
        assert one["leakage_peak"].value == pytest.approx(truth, abs=3.0 * one["leakage_peak"].std)
        assert one["leakage_peak"].std < 0.01
        assert one["leakage_peak_at"].value == pytest.approx(0.8, abs=3.0 * one["leakage_peak_at"].std + 0.03)
        assert one["leakage_peak_at"].std < 0.2
        assert one["leakage_high"].value == pytest.approx(0.2, abs=0.012)


def test_a_run_that_ended_before_the_sweep_about_neutral_has_ends_alone():
    findings, one = found(half=True)
    assert set(one) == {"leakage_high", "leakage_low"}
    assert [curve["label"] for curve in findings.curves["internal_leakage"]] == ["whole range"]


def test_a_peak_beyond_the_sweep_about_neutral_has_no_middle():
    assert found(null=9.8)[1]["leakage_peak_at"].value is None
