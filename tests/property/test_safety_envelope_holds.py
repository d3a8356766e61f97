"""No sequence of calls passes a sample outside the envelope through the guard."""

from __future__ import annotations

import math
from contextlib import nullcontext, suppress

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from wire import Wire

from hil.clock import VirtualClock
from hil.daq.contract import Waveform
from hil.errors import HilError, RangeError
from hil.safety.envelope import Dwell, Envelope
from hil.safety.guard import Guard
from hil.safety.interlock import Band, Interlock
from hil.safety.protection import Protection

values = st.one_of(st.floats(-12.0, 12.0), st.sampled_from([math.nan, math.inf, 0.0, 3.0, -3.0, 3.0000001]))
samples = st.one_of(
    st.lists(values, min_size=1, max_size=12),
    st.builds(lambda a, b, n: np.linspace(a, b, n).tolist(), st.floats(-4, 4), st.floats(-4, 4), st.integers(2, 60)),
    st.builds(lambda level, n: [level] * n, st.floats(-3, 3), st.integers(1, 120)),
)
rates = st.sampled_from([10.0, 25.0, 100.0])
envelopes = st.builds(
    lambda low, high, slew, level, longest: Envelope(low, high, slew, (Dwell(level, longest),)),
    st.floats(-9.0, -0.5), st.floats(0.5, 9.0), st.sampled_from([math.inf, 5.0, 40.0]), st.floats(0.2, 4.0),
    st.floats(0.1, 3.0),
)  # fmt: skip
calls = st.lists(
    st.one_of(
        st.tuples(st.just("play"), samples, rates),
        st.tuples(st.just("stream"), st.lists(samples, min_size=1, max_size=4), rates, st.integers(0, 4)),
        st.tuples(st.just("tighten"), envelopes),
        st.tuples(st.just("stand"), st.floats(0.0, 3.0)),
        st.tuples(st.just("fault"), st.sampled_from([0.0, 5.0])),
        st.tuples(st.just("make safe")),
    ),
    max_size=12,
)


moves = st.lists(
    st.one_of(
        st.tuples(st.just("play"), st.sampled_from([0.0, -5.0, 5.0, -9.0, 9.0]), st.integers(1, 30)),
        st.tuples(st.just("stand"), st.just(0.0), st.integers(1, 20)),
    ),
    max_size=12,
)
dwells = st.lists(st.tuples(st.sampled_from([3.0, 8.0]), st.integers(5, 30)), max_size=3, unique=True)


def act(guard: Guard, wire: Wire, clock: VirtualClock, call: tuple) -> None:
    match call:
        case ("play", values, rate_hz):
            for _ in guard.play(Waveform(rate_hz, {"a": np.array(values)}), 7):
                pass
        case ("stream", many, rate_hz, taken):
            blocks = guard.stream(Waveform(rate_hz, {"a": np.array(values)}) for values in many)
            for _ in range(taken):
                next(blocks, None)
            blocks.close()
        case ("tighten", envelope):
            guard.tighten("a", envelope)
        case ("stand", duration_s):
            clock.sleep_until(clock.now_s + duration_s)
        case ("fault", offset):
            wire.offset = offset
        case ("make safe",):
            guard.make_safe()


def check(log: list[tuple[float, float | None]], envelope: Envelope, ramp_per_s: float) -> None:
    (dwell,) = envelope.dwells
    before, beyond_s = 0.0, 0.0
    for value, rate_hz in log:
        assert envelope.low <= value <= envelope.high
        if rate_hz is None:
            assert value == 0.0  # only the safe value may be jumped to
            before, beyond_s = value, 0.0
            continue
        fastest = max(envelope.slew_per_s, ramp_per_s)
        assert abs(value - before) <= fastest / rate_hz + 1e-6
        beyond_s = beyond_s + 1.0 / rate_hz if abs(value) > dwell.level else 0.0
        assert beyond_s <= dwell.longest_s + 9.0 / ramp_per_s + 1e-6  # the way down comes on top
        before = value


@settings(max_examples=150, deadline=None)
@given(envelopes, calls, st.sampled_from(["stop", "trip", "hold", "indicate"]), st.sampled_from([5.0, 60.0]))
def test_nothing_outside_the_envelope_reaches_the_output(envelope, sequence, action, ramp_per_s):
    wire, clock = Wire(), VirtualClock()
    lock = Interlock("read", action, Band("a read", -4.0, 4.0, minus="a"))  # type: ignore[arg-type]
    protection = Protection(20.0, {"a": envelope}, {"a": ramp_per_s}, (lock,), block_s=0.1, patience_s=0.2)
    guard = Guard(wire, protection, clock=clock)
    for call in sequence:
        with suppress(HilError):
            act(guard, wire, clock, call)
        if guard.latch.trips:
            guard.latch.reset("read")
    with suppress(HilError):
        guard.close()
    check(wire.log["a"], envelope, ramp_per_s)
    assert wire.levels["a"] == 0.0
    assert not wire.log["b"] or {value for value, _ in wire.log["b"]} == {0.0}


@given(dwells, dwells, moves)
@example([(8.0, 20)], [(3.0, 5)], [("play", -5.0, 6)])
def test_every_dwell_is_counted_sample_by_sample_whatever_came_before(stated, added, sequence):
    """Ten samples a second; a level is played, or stood at. Dwells are those of the bench, and what tightens them."""
    limits, more = (
        Envelope(-10.0, 10.0, dwells=tuple(Dwell(at, most / 10.0) for at, most in own)) for own in (stated, added)
    )
    clock = VirtualClock()
    guard = Guard(Wire(), Protection(10.0, {"a": limits}, block_s=0.1), clock=clock)
    guard.tighten("a", more)
    stands, beyond = 0.0, dict.fromkeys([*stated, *added], 0)
    for what, level, count in sequence:
        if what == "stand":
            level = stands
            clock.sleep_until(clock.now_s + count / 10.0)
        beyond = {(at, most): n + count if abs(level) > at else 0 for (at, most), n in beyond.items()}
        if what == "play":
            is_too_long = any(n > most for (_, most), n in beyond.items())
            with pytest.raises(RangeError, match="beyond") if is_too_long else nullcontext():
                for _ in guard.play(Waveform(10.0, {"a": np.full(count, level)})):
                    pass
            if is_too_long:
                return
        stands = level
