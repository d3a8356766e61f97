"""Blocks played and judged as one in virtual time leave what they leave one by one, wherever something ends."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated import FLOW, READ_BACK, SPOOL, hpv41

from hil.daq.contract import Block, Waveform, joined
from hil.errors import HilError
from hil.safety.guard import Guard
from hil.safety.interlock import Band, Interlock
from hil.safety.protection import Protection
from tests.driven import played

EFFECTS = [
    {"name": "friction", "parameters": {"coulomb": 2.0}},
    {"name": "periodic_disturbance", "hook": "sensor"},
    {"name": "hysteresis", "hook": "pilot"},
]
INPUTS = {"flow": {**FLOW, "noise": 0.3}, "spool": {**SPOOL, "noise": 0.1}, "read back": READ_BACK}


class OneByOne:
    """The same device without a way back."""

    roll_back = None

    def __init__(self, daq: Any) -> None:
        self._daq = daq

    def __getattr__(self, name: str) -> Any:
        return getattr(self._daq, name)


def left(interlocks: list[Interlock], pieces: list[int], block_s: float, fault: Any, *, at_once: bool) -> list[Any]:
    """What a run leaves: rows, events, when each piece was asked for, how it ended, and how the device goes on."""
    daq = hpv41(INPUTS, skew_s=20e-6, noise_v=1e-4, simulation={"effects": EFFECTS, "seed": 7}, fault=fault)
    kept: list[Block] = []
    events: list[Any] = []

    def rows() -> int:
        return sum(map(len, kept))

    def waveforms() -> Iterator[Waveform]:
        first = 0
        for samples in pieces:
            events.append(("asked for", samples, rows()))
            yield Waveform(1000.0, {"command": 4.0 + 3.0 * np.sin(0.004 * np.arange(first, first + samples))})
            first += samples

    guard = Guard(
        daq if at_once else OneByOne(daq), Protection(1000.0, interlocks=interlocks, block_s=block_s, patience_s=0.4),
        keep=kept.append, note=lambda event, **details: events.append((event, details, rows())),
    )  # fmt: skip
    ended = ""
    try:
        for _ in guard.stream(waveforms()):
            pass
        played(guard, Waveform(1000.0, {"command": np.full(1500, 5.0)}))
        guard.close()
    except HilError as error:
        ended = f"{type(error).__name__}: {error}"
    recorded = len(kept)
    with suppress(HilError):  # it is gone
        kept += daq.play(Waveform(1000.0, {"command": np.full(20, 1.0)}))
    whole = joined(kept)
    shown = {name: values.tobytes() for name, values in {"time": whole.time_s, **whole.columns}.items()}
    count, text = sum(map(len, kept[:recorded])), guard.output_states.text
    return [count, shown, events, ended, guard.latch.trips, text, daq.read_back()]


locks = st.builds(
    Interlock,
    st.sampled_from(["a", "b", "c"]),
    st.sampled_from(["indicate", "hold", "stop", "trip"]),
    st.builds(
        Band, st.sampled_from([*INPUTS, "command"]), st.sampled_from([-np.inf, 0.5, 2.0]),
        st.sampled_from([4.0, 5.5, 6.9, np.inf]), st.sampled_from(["", "command"]),
    ),
    st.sampled_from([0.0, 0.003, 0.15]),
    st.none() | st.just(Band("command", 3.0, 6.0)),
    st.sampled_from([None, 0.004, 0.2]),
)  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(
    st.lists(locks, max_size=3),
    st.lists(st.integers(1, 2500), min_size=1, max_size=4),
    st.sampled_from([0.01, 0.1, 0.7]),
    st.none() | st.builds(dict, kind=st.sampled_from(["lost", "underflow"]), after=st.integers(200, 3000)),
)
def test_the_same_is_left_wherever_something_ends(interlocks, pieces, block_s, fault):
    found = left(interlocks, pieces, block_s, fault, at_once=True)
    assert found == left(interlocks, pieces, block_s, fault, at_once=False)
