"""A reading that stands longer than its own noise allows breaks its interlock; what rests by itself does not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.daq.contract import Block
from hil.record.recording import Array
from hil.safety.interlock import Band, Interlock, Watches
from hil.safety.standstill import Standstill

RATE_HZ = 250
HELD = 100  # 0.4 s


def read(codes: float, seed: int = 0, count: int = 5000, period: int = 1, cut: float = 0.0) -> Array:
    """Steps read in whole codes, with noise of so many of them, `period` readings to a conversion."""
    rng = np.random.default_rng(seed)
    steps = np.repeat(rng.uniform(-500.0, 500.0, 11), 500)[: count // period]
    read = np.rint(steps + codes * rng.standard_normal(len(steps)))
    return np.repeat(np.where(np.abs(read) < cut, 0.0, read), period)


def repeated(values: Array, block: int = 25) -> np.ndarray:
    state, found = Standstill.begun(), []
    for at in range(0, len(values), block):
        state, beyond = state.after(values[at : at + block])
        found.append(beyond)
    return np.concatenate(found)


@pytest.mark.parametrize("period", [1, 4])
@pytest.mark.parametrize("codes", [0.0, 0.3, 0.5, 1.0, 2.0, 5.0])
@pytest.mark.parametrize("cut", [0.0, 40.0])
def test_what_a_channel_does_by_itself_is_no_standstill(codes, period, cut):
    assert not any(repeated(read(codes, seed, 10_000, period, cut), 250).any() for seed in range(10))


@pytest.mark.parametrize("cycle", [8.3, 9.1, 10.3])
def test_what_swings_without_noise_is_no_noise(cycle):
    """It rests on a code near which a swing turns; seen from there alone it turns as noise does."""
    swing = np.rint(60.0 * np.sin(2.0 * np.pi * np.arange(3000) / cycle))
    assert not repeated(np.concatenate([swing, [200.0, -200.0], np.full(2000, 57.0)])).any()


def test_a_rest_below_a_cut_off_is_one_also_after_noise_at_its_edge():
    rng = np.random.default_rng(1)
    edge, middle = (level + 3.0 * rng.standard_normal(2500) for level in (20.0, 0.0))
    read = np.rint(np.concatenate([-edge, edge, middle]))
    assert not repeated(np.where(np.abs(read) < 20.0, 0.0, read)).any()


@pytest.mark.parametrize("codes", [2.0, 5.0])
def test_a_reading_that_stands_for_0_4_s_is_found(codes):
    found = 0
    for seed in range(50):
        values = read(codes, seed)
        rest = np.sort(values[2500:2700])
        values[2700 : 2700 + HELD] = np.clip(values[2700], rest[20], rest[-20])
        found += bool(repeated(values)[2700 : 2700 + HELD].any())
    assert found >= 49


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([1, 7, 250, 3000]), st.integers(20, 6000))
def test_how_readings_are_cut_into_blocks_changes_nothing(seed, block, held):
    values = read(3.0, seed, 8000)
    values[1500 : 1500 + held] = values[1499]
    assert np.array_equal(repeated(values, block), repeated(values, len(values)))


@pytest.mark.parametrize("is_emergency_stop", [False, True])
def test_a_frozen_channel_breaks_its_interlock_and_says_why(is_emergency_stop):
    """Also a contact that is read as a voltage: nobody pressed."""
    values = read(3.0)
    values[2700:] = np.median(values[2500:2700])
    lock = Interlock("contact", "trip", Band("contact", low=-1000.0), is_emergency_stop=is_emergency_stop)
    watches, cuts = Watches([lock]), [slice(at, at + 25) for at in range(0, 2900, 25)]
    blocks = [Block(np.arange(cut.start, cut.stop) / RATE_HZ, {"contact": values[cut]}, {}) for cut in cuts]
    found = [violation for one in blocks for violation in watches.judge(one)]
    assert len(found) == 1 and "repeats itself" in found[0].text
    assert 2700 / RATE_HZ < found[0].time_s < 2800 / RATE_HZ
