"""The work of a study, in processes of its own."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import connection
from typing import Any, TypeVar

_Found = TypeVar("_Found")


def finished(
    work: Callable[..., _Found], calls: Sequence[Sequence[Any]], jobs: int
) -> Iterator[tuple[int, _Found]]:  # fmt: skip
    """What work gives for each call, with the call's number, as it is done; with one job in this process."""
    if jobs == 1:
        yield from ((number, work(*call)) for number, call in enumerate(calls))
        return
    context = multiprocessing.get_context("spawn")  # no forks beside threads
    with ProcessPoolExecutor(min(jobs, max(1, len(calls))), context, _end_with_parent) as pool:
        started = {pool.submit(work, *call): number for number, call in enumerate(calls)}
        yield from ((started[done], done.result()) for done in as_completed(started))


def _end_with_parent() -> None:
    """End this process when the one that started it is killed; a pool's workers would wait for ever."""

    def wait() -> None:
        parent = multiprocessing.parent_process()
        if parent is not None:
            connection.wait([parent.sentinel])
            os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
