"""Waiting for what happens on a real line or in a real process: as long as it takes, judged by nobody's clock."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

PATIENCE_S = 600.0
"""Beyond it something hangs; a computer that is busy takes minutes now and then."""
_Case, _Found = TypeVar("_Case"), TypeVar("_Found")


def until(what: Callable[[], object], within_s: float = PATIENCE_S, every_s: float = 0.02) -> float:
    """How long it takes until a function says yes, in s; fails when it does not in time."""
    begun_s = time.monotonic()
    while not what():
        assert time.monotonic() - begun_s < within_s, f"not within {within_s} s"
        time.sleep(every_s)
    return time.monotonic() - begun_s


def side_by_side(try_one: Callable[[_Case], _Found], cases: Iterable[_Case]) -> list[_Found]:
    """What is found in cases each of which waits for an answer that does not come: they wait at the same time."""
    every = list(cases)
    with ThreadPoolExecutor(len(every)) as threads:
        return list(threads.map(try_one, every))
