"""Interlocks: when a condition counts as broken."""

from __future__ import annotations

import numpy as np
import pytest

from hil.daq.contract import Block
from hil.safety.interlock import Band, Interlock, Watch


def block(flow: list[float], command: list[float] | None = None, start: int = 0) -> Block:
    time_s = 0.1 * np.arange(start, start + len(flow))
    return Block(time_s, {"flow": np.array(flow)}, {"command": np.array(command or [0.0] * len(flow))})


def test_a_range_with_two_sides() -> None:
    lock = Interlock("flow", "trip", Band("flow", -1.0, 1.0))
    assert Watch(lock).judge(block([0.0, 1.0, -1.0])) is None
    assert Watch(lock).judge(block([0.0, 1.1])).time_s == pytest.approx(0.1)
    assert Watch(lock).judge(block([0.0, -1.1])).time_s == pytest.approx(0.1)


def test_it_must_last_also_across_blocks() -> None:
    watch = Watch(Interlock("flow", "trip", Band("flow", high=1.0), for_s=0.3))
    assert watch.judge(block([2.0, 2.0, 0.0, 2.0, 2.0])) is None
    assert watch.judge(block([2.0, 2.0], start=5)).time_s == pytest.approx(0.6)


def test_what_is_broken_lasts_until_the_next_reading_can_come() -> None:
    lock = Interlock("flow", "trip", Band("flow", high=1.0), for_s=0.3)
    assert Watch(lock).judge(block([0.0, 2.0]), blind_s=0.2) is None
    assert Watch(lock).judge(block([0.0, 2.0]), blind_s=0.3).time_s == pytest.approx(0.1)
    assert Watch(lock).judge(block([2.0, 0.0]), blind_s=0.3) is None


def test_a_block_in_order_ends_what_lasted() -> None:
    watch = Watch(Interlock("flow", "trip", Band("flow", high=1.0), for_s=0.3))
    assert watch.judge(block([2.0, 2.0])) is None
    assert watch.judge(block([0.0, 0.0], start=2)) is None
    assert watch.judge(block([2.0, 2.0], start=4)) is None


def test_flow_without_command_is_asked_for_only_without_command() -> None:
    lock = Interlock("leak", "trip", Band("flow", -1.0, 1.0), only_while=Band("command", -5.0, 5.0))
    assert Watch(lock).judge(block([9.0, 9.0], [50.0, 50.0])) is None
    assert Watch(lock).judge(block([9.0, 9.0], [50.0, 0.0])).time_s == pytest.approx(0.1)


def test_difference_of_two_channels() -> None:
    lock = Interlock("error", "stop", Band("flow", -1.0, 1.0, minus="command"))
    assert Watch(lock).judge(block([9.0, 9.5], [9.0, 9.0])) is None
    assert "flow − command" in Watch(lock).judge(block([9.0, 9.5], [9.0, 7.0])).text


def test_reading_that_stands_still_is_stale() -> None:
    lock = Interlock("dead", "stop", Band("flow"), stale_s=0.3)
    watch = Watch(lock)
    assert watch.judge(block([1.0, 1.0, 1.0, 2.0, 2.0])) is None
    found = watch.judge(block([2.0, 2.0, 2.0], start=5))
    assert found.time_s == pytest.approx(0.7)
    assert "dead sensor" in found.text


def test_what_goes_on_is_told_once_and_what_ended_is_not_broken() -> None:
    watch = Watch(Interlock("flow", "indicate", Band("flow", high=1.0)))
    assert watch.judge(block([2.0, 2.0])) is not None
    assert watch.judge(block([2.0, 2.0], start=2)) is None
    assert watch.broken
    assert watch.judge(block([2.0, 0.0], start=4)) is None
    assert not watch.broken
    assert watch.judge(block([2.0], start=6)) is not None


def test_text_says_value_limit_condition_and_time() -> None:
    lock = Interlock("leak", "trip", Band("flow", -1.0, 1.0), for_s=0.1, only_while=Band("command", -5.0, 5.0))
    assert Watch(lock).judge(block([9.0, 9.25])).text == (
        "interlock 'leak': 9.25 for 0.1 s while command in -5 … 5; allowed: flow in -1 … 1 at 0.100 s"
    )
