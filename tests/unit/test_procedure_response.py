"""A frequency response as findings: nothing is counted from a reference that is noise."""

from __future__ import annotations

import numpy as np
import pytest

from hil.identification.frequency.bandwidth import bandwidth
from hil.identification.frequency.frequency_response import FrequencyResponse
from hil.record.measured import judge
from procedures._response import Evaluated, reference_deviations

FREQUENCY_HZ = np.linspace(0.1, 4.9, 25)


def found(noise: float, late_s: float = 0.0) -> Evaluated:
    """A first-order response of 1 Hz with noise on every line, later than the command by as much."""
    lines = len(FREQUENCY_HZ)
    drawn = np.random.default_rng(3).normal(size=(2, lines)) * noise
    ones = np.ones(lines)
    response = FrequencyResponse(
        "run", FREQUENCY_HZ,
        np.exp(-2j * np.pi * late_s * FREQUENCY_HZ) / (1.0 + 1j * FREQUENCY_HZ) + drawn[0] + 1j * drawn[1],
        np.tile(noise**2 * np.eye(2), (lines, 1, 1)), "A", "mm", 0.1, 0.0,
        ones, noise * ones, np.zeros((lines, 4), dtype=np.complex128),
    )  # fmt: skip
    return Evaluated("+0 ± 0.1 A", response, bandwidth(response), None, ("no model",))


def values(one: Evaluated) -> dict[str, float | None]:
    return {m.quantity: m.value for m in one.measured()}


def test_a_response_within_its_noise_has_no_bandwidth():
    lost = found(noise=5.0)
    assert values(lost)["bandwidth_3db"] is None
    assert values(lost)["bandwidth_90deg"] is None
    assert lost.curve()["bandwidth_3db_hz"] is None
    (said,) = lost.explained()
    assert "the valve does not follow here: its response at 0.1 Hz, the reference, is within its noise" in said
    assert reference_deviations([lost]) == ()


def test_a_response_that_follows_has_one():
    clear = found(noise=0.001)
    assert values(clear)["bandwidth_3db"] == pytest.approx(1.0, rel=0.03)
    assert clear.curve()["bandwidth_3db_hz"] == pytest.approx(1.0, rel=0.03)
    assert clear.explained() == ("no model",)


def test_a_bandwidth_before_the_lowest_line_is_a_bound_that_proves_no_least_bandwidth():
    (bound,) = (m for m in found(noise=0.001, late_s=3.0).measured() if m.quantity == "bandwidth_90deg")
    assert (bound.relation, bound.value) == ("<", pytest.approx(0.1))
    verdicts = [judge(bound.value, bound.std, low, None, bound.relation) for low in (0.05, 0.2)]
    assert verdicts == ["cannot tell", "fail"]
