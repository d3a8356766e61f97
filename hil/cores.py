"""Spread independent work over this machine's cores, at any depth, with no more threads at work than cores.

HIL_CORES says how many may be used; without it, as many as the system lets this program run on.
"""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import cache
from typing import TypeVar

from hil.errors import SettingError


def cores() -> int:
    """How many cores this program may use.

    Raises:
        SettingError: HIL_CORES is no number from 1 on.
    """
    setting = os.environ.get("HIL_CORES")
    if not setting:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if not setting.isdecimal() or int(setting) < 1:
        raise SettingError(f"HIL_CORES = {setting!r} in the environment: say how many cores to use, 1 or more")
    return int(setting)


_CORES = cores()
# One of them is the caller's.
_idle = threading.Semaphore(_CORES - 1)
# Set from Ctrl-C until the work that it broke off has ended on every core.
_broken_off = threading.Event()
_here = threading.local()


class _BrokenOffError(BaseException):
    """Ctrl-C on another core."""


_Item = TypeVar("_Item")
_Found = TypeVar("_Found")


def keep_to(most: int) -> None:
    """From now on use no more than so many cores: other processes of the same work have the rest."""
    global _CORES
    while max(most, 1) < _CORES:
        _idle.acquire()
        _CORES -= 1


def parallel_map(function: Callable[[_Item], _Found], items: Iterable[_Item]) -> list[_Found]:
    """`[function(item) for item in items]`, each by the caller or by a core that is idle when its turn comes.

    Worth it for what releases the interpreter's lock, as compiled kernels do. `function` may spread work of its own:
    where no core is idle, that costs no more than a loop. Once one of them raises, no other is begun; Ctrl-C also ends
    what other cores are at, as soon as that spreads work of its own.
    """
    pending = deque(enumerate(items))
    found: dict[int, _Found] = {}
    helpers: list[Future[None]] = []

    def take_one() -> None:
        if _broken_off.is_set():
            raise _BrokenOffError
        try:
            k, item = pending.popleft()
        except IndexError:  # another thread took the last one
            return
        try:
            found[k] = function(item)
        except BaseException:
            pending.clear()
            raise

    def help_out() -> None:
        try:
            while pending:
                take_one()
        finally:
            _idle.release()

    _here.depth = getattr(_here, "depth", 0) + 1
    try:
        while pending:
            helpers += _recruited(help_out, most=len(pending) - 1)
            take_one()
    except KeyboardInterrupt:
        _broken_off.set()
        raise
    finally:
        begun = _finished(helpers)
        _here.depth -= 1
        if not _here.depth and threading.current_thread() is threading.main_thread():  # nobody else hears Ctrl-C
            _broken_off.clear()
    for helper in begun:
        helper.result()
    return [found[k] for k in range(len(found))]


def _recruited(help_out: Callable[[], None], most: int) -> list[Future[None]]:
    """As many helpers as cores are idle."""
    recruited: list[Future[None]] = []
    while len(recruited) < most and _idle.acquire(blocking=False):
        recruited.append(_threads().submit(help_out))
    return recruited


def _finished(helpers: Sequence[Future[None]]) -> list[Future[None]]:
    """Those that began, once they are done; who has not begun is not needed any more."""
    begun = [helper for helper in helpers if not helper.cancel()]
    for _ in range(len(helpers) - len(begun)):
        _idle.release()
    if not all(helper.done() for helper in begun):
        _idle.release()  # the core that waits
        try:
            wait(begun)
        finally:
            _idle.acquire()
    return begun


@cache
def _threads() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(_CORES, thread_name_prefix="core")
