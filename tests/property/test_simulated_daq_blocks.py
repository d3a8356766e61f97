"""The simulated DAQ gives the same samples bit for bit, however they are cut into blocks and tasks."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated import FLOW, READ_BACK, SPOOL, hpv41

from hil.daq.contract import Block, Waveform, joined

EFFECTS = [
    {"name": "friction", "parameters": {"coulomb": 2.0}},
    {"name": "periodic_disturbance", "hook": "sensor"},
    {"name": "hysteresis", "hook": "pilot"},
]
INPUTS = {"flow": {**FLOW, "noise": 0.3}, "spool": {**SPOOL, "noise": 0.1}, "read back": READ_BACK}
TIME = np.arange(2000)
COMMAND = 4.0 + 2.0 * np.sin(0.02 * TIME) + 0.5 * np.sign(np.sin(0.11 * TIME))


def run(tasks: list[int], block: int, every: int, streamed: bool) -> Block:
    daq = hpv41(INPUTS, skew_s=20e-6, noise_v=1e-4, simulation={"effects": EFFECTS, "seed": 7})
    cuts = np.cumsum([0, *tasks])
    pieces = [COMMAND[a:b] for a, b in zip(cuts, [*cuts[1:], len(COMMAND)], strict=True) if len(COMMAND[a:b])]
    blocks = []
    for piece in pieces:
        waveform = Waveform(1000.0 / every, {"command": piece})
        blocks += list(daq.stream(waveform.slices(block)) if streamed else daq.play(waveform, block))
    return joined(blocks)


WHOLE = {every: run([], 2000, every, streamed=False) for every in (1, 3)}


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(1, 900), max_size=4), st.integers(1, 999), st.sampled_from([1, 3]), st.booleans())
def test_cut_as_you_like(tasks, block, every, streamed):
    found, whole = run(tasks, block, every, streamed), WHOLE[every]
    assert np.array_equal(found.time_s, whole.time_s)
    for name in INPUTS:
        assert np.array_equal(found.inputs[name], whole.inputs[name]), name
