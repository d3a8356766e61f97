"""A channel that stands frozen within a step is told; one that rests on a code of its converter is not."""

from __future__ import annotations

import numpy as np
import pytest

from hil.record.frozen import frozen_channels
from hil.record.recording import Array, recording

RATE_HZ, HELD = 25.0, 50
CODE = 100.0 / 0x7FFF
COMMAND = np.repeat([0.0, 50.0, 0.0], HELD)
FROZEN = slice(HELD + 2, HELD + 12)  # 0.4 s, from 0.08 s after the step


def response(noise_std: float, code: float, seed: int = 1) -> Array:
    """Of first order, 0.15 s, with noise, as a converter reads it."""
    flow = np.zeros(len(COMMAND))
    for i in range(1, len(flow)):
        flow[i] = flow[i - 1] + (COMMAND[i] - flow[i - 1]) * -np.expm1(-1.0 / (RATE_HZ * 0.15))
    noisy = flow + noise_std * np.random.default_rng(seed).normal(size=len(flow))
    read: Array = np.round(noisy / code) * code if code else noisy
    return read


def said(flow: Array, **more: Array) -> tuple[str, ...]:
    columns = {"command [%]": COMMAND, "flow [l/min]": flow, **{f"{name} [bar]": v for name, v in more.items()}}
    meta = {"roles": {"command": "command", "response": "flow"}, "outputs": {"command": {}}}
    return frozen_channels(recording("run", np.arange(len(COMMAND)) / RATE_HZ, columns, meta))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("code", [0.0, CODE, 0.05])
def test_a_channel_that_is_frozen_within_a_step_is_told_with_its_time(code, seed):
    flow = response(0.2, code, seed)
    assert said(flow) == ()
    flow[FROZEN] = flow[FROZEN.start - 1]
    (sentence,) = said(flow)
    assert sentence.startswith(f"'flow' stood at {flow[FROZEN.start]:.6g} l/min in 11 samples, 2.040 … 2.440 s")


def test_another_channel_than_the_response_is_told_too():
    supply = 140.0 + np.random.default_rng(2).normal(size=len(COMMAND))
    supply[FROZEN] = supply[FROZEN.start]
    (sentence,) = said(response(0.2, CODE), supply=supply)
    assert sentence.startswith("'supply' stood")


def test_a_channel_that_is_frozen_to_the_end_is_told():
    spool = response(0.2, CODE, 3)
    spool[HELD + 2 :] = spool[HELD + 2]
    (sentence,) = said(response(0.2, CODE), spool=spool)
    assert sentence.startswith("'spool' stood") and "5.960 s" in sentence


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("noise", [0.0, 0.01, 0.1, 0.3, 0.6, 1.0])  # of a code
@pytest.mark.parametrize("code", [0.1, 1.0])
def test_resting_on_a_code_is_no_frozen_channel(noise, code, seed):
    assert said(response(noise * code, code, seed)) == ()


def test_rest_below_a_cut_off_a_slow_instrument_and_no_noise_are_no_frozen_channel():
    cut_off = response(0.2, CODE)
    cut_off[cut_off < 1.0] = 0.0
    slow = np.repeat(response(0.2, CODE)[::10], 10)
    assert said(cut_off) == () and said(slow) == () and said(response(0.0, 0.0)) == ()
    overlap = response(0.2, CODE)  # no flow and no noise below a threshold, whatever the command does
    overlap[:10] = overlap[HELD - 20 : HELD + 20] = 0.0
    assert said(overlap) == ()
    stuck = response(0.0, CODE)  # a cylinder that sticks and slips, read by an encoder
    stuck[FROZEN] = stuck[FROZEN.start]
    assert said(stuck) == ()
