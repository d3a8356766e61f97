"""Interlocks: when a condition counts as broken."""

from __future__ import annotations

import numpy as np
import pytest

from hil.daq.contract import Block
from hil.safety.interlock import Band, Interlock, Watch


def block(flow: list[float], command: list[float] | None = None, start: int = 0) -> Block:
    time_s = 0.1 * np.arange(start, start + len(flow))
    return Block(time_s, {"flow": np.array(flow)}, {"command": np.array(command or [0.0] * len(flow))})


HIGH = Band("flow", high=1.0)
RANGE = Interlock("flow", "trip", Band("flow", -1.0, 1.0))
LASTS = Interlock("flow", "trip", HIGH, for_s=0.3)
LEAK = Interlock("leak", "trip", Band("flow", -1.0, 1.0), only_while=Band("command", -5.0, 5.0))
ERROR = Interlock("error", "stop", Band("flow", -1.0, 1.0, minus="command"))
STALE = Interlock("dead", "stop", Band("flow"), stale_s=0.3)


@pytest.mark.parametrize(
    ("lock", "blocks", "command", "broken_s", "says"),
    [
        (RANGE, [[0.0, 1.0, -1.0]], None, None, ""),
        (RANGE, [[0.0, 1.1]], None, 0.1, ""),
        (RANGE, [[0.0, -1.1]], None, 0.1, ""),
        (LASTS, [[2.0, 2.0, 0.0, 2.0, 2.0], [2.0, 2.0]], None, 0.6, ""),  # across blocks
        (LASTS, [[2.0, 2.0], [0.0, 0.0], [2.0, 2.0]], None, None, ""),
        (LEAK, [[9.0, 9.0]], [50.0, 50.0], None, ""),
        (LEAK, [[9.0, 9.0]], [50.0, 0.0], 0.1, ""),
        (ERROR, [[9.0, 9.5]], [9.0, 9.0], None, ""),
        (ERROR, [[9.0, 9.5]], [9.0, 7.0], 0.1, "flow − command"),
        (STALE, [[1.0, 1.0, 1.0, 2.0, 2.0], [2.0, 2.0, 2.0]], None, 0.7, "dead sensor"),
    ],
)
def test_it_is_broken_in_the_last_block_or_not_at_all(lock, blocks, command, broken_s, says):
    watch, start = Watch(lock), 0
    for values in blocks[:-1]:
        assert watch.judge(block(values, command, start)) is None
        start += len(values)
    found = watch.judge(block(blocks[-1], command, start))
    assert (found and found.time_s) == pytest.approx(broken_s)
    assert says in (found.text if found else "")


def test_what_is_broken_lasts_until_the_next_reading_can_come():
    assert Watch(LASTS).judge(block([0.0, 2.0]), blind_s=0.2) is None
    assert Watch(LASTS).judge(block([0.0, 2.0]), blind_s=0.3).time_s == pytest.approx(0.1)
    assert Watch(LASTS).judge(block([2.0, 0.0]), blind_s=0.3) is None


def test_what_goes_on_is_told_once_and_what_ended_is_not_broken():
    watch = Watch(Interlock("flow", "indicate", HIGH))
    assert watch.judge(block([2.0, 2.0])) is not None
    assert watch.judge(block([2.0, 2.0], start=2)) is None
    assert watch.broken
    assert watch.judge(block([2.0, 0.0], start=4)) is None
    assert not watch.broken
    assert watch.judge(block([2.0], start=6)) is not None


def test_text_says_value_limit_condition_and_time():
    lock = Interlock("leak", "trip", Band("flow", -1.0, 1.0), for_s=0.1, only_while=Band("command", -5.0, 5.0))
    assert Watch(lock).judge(block([9.0, 9.25])).text == (
        "interlock 'leak': 9.25 for 0.1 s while command in -5 … 5; allowed: flow in -1 … 1 at 0.100 s"
    )
