"""Processes of our own: the one place where this program starts another.

Nothing that lies in a working folder is executed in one: `-P` keeps that folder off the path where Python looks for
modules, and an empty entry of PYTHONPATH, which means the same folder, is left out.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

Process = subprocess.Popen
PIPE, TimeoutExpired = subprocess.PIPE, subprocess.TimeoutExpired

_PATH, _SAFE_PATH = "PYTHONPATH", "PYTHONSAFEPATH"
_AHEAD = 2  # items for each process: one that it is at, one that waits for it
_starting = threading.Lock()

_Item = TypeVar("_Item")
_Found = TypeVar("_Found")


def child(
    module: str, arguments: Sequence[str] = (), environment: Mapping[str, str] | None = None, **how: Any
) -> Process[Any]:
    """Start `python -m MODULE ARGUMENTS…`.

    Args:
        module: `hil` for a command, or one of its modules.
        arguments: of it, never read by a shell.
        environment: what it is told beside this environment.
        how: as `subprocess.Popen` takes it: its streams, its folder.

    Raises:
        OSError: it cannot be started.
    """
    return Process(python(module, *arguments), env={**_environment(), **(environment or {})}, **how)


def python(module: str, *arguments: str) -> list[str]:
    """The command line of a module in this Python."""
    return [sys.executable, "-P", "-m", module, *arguments]


def finished(command: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """Run another program, such as a compiler, to its end, without input; its output is kept."""
    return subprocess.run(
        command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False, env=_environment()
    )


def processes(workers: int, prepare: Callable[[], None] | None = None) -> Executor:
    """So many processes of this Python, each of which does `prepare` first."""
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    with _safe_path():  # it starts one of its own, too
        return ProcessPoolExecutor(workers, get_context("spawn"), prepare)


def over_processes(
    function: Callable[[_Item], _Found],
    items: Iterable[_Item],
    workers: Callable[[], int],
    lost: Callable[[_Item], _Found],
    tell: Callable[[str], None] = lambda _text: None,
    pools: Callable[[int], Executor] = processes,
    broken: type[Exception] = BrokenExecutor,
) -> Iterator[_Found]:
    """What a function gives of each item, in one of some processes; as they are finished, in any order.

    Items are taken as processes come free, so that there may be any number of them. Those that were at work when a
    process was lost (killed, or out of memory) are done once more, one by one.

    Args:
        function: what is done, with what it needs within it.
        items: what to do it with.
        workers: how many processes there are now.
        lost: what stands for an item whose process was lost that time too.
        tell: told in a sentence that a process was lost.
        pools: so many processes that take work.
        broken: what a lost process leaves of its work.
    """

    def alone(item: _Item) -> _Found:
        with pools(1) as pool:
            try:
                return _begun(pool, function, item).result()
            except broken:
                return lost(item)

    at_work: dict[Future[_Found], _Item] = {}
    suspects: list[_Item] = []
    todo = iter(items)
    pool = pools(workers())
    try:
        while True:
            with suppress(broken):  # what was at work says so too
                for item in islice(todo, 0 if suspects else max(0, _AHEAD * workers() - len(at_work))):
                    suspects.append(item)
                    begun = _begun(pool, function, item)
                    at_work[begun] = suspects.pop()
            if not (at_work or suspects):
                return
            for future in wait(at_work, return_when=FIRST_COMPLETED).done:
                item = at_work.pop(future)
                if isinstance(future.exception(), broken):
                    suspects.append(item)
                else:
                    yield future.result()
            if suspects and not at_work:
                tell(f"a process was lost while {len(suspects)} were at work or waited; each is done again by itself")
                pool.shutdown()
                yield from map(alone, suspects)
                suspects, pool = [], pools(workers())
    finally:
        for future in at_work:
            future.cancel()
        pool.shutdown()


def _begun(pool: Executor, function: Callable[[_Item], _Found], item: _Item) -> Future[_Found]:
    with _safe_path():  # a process starts when it is given something to do
        return pool.submit(function, item)


def _environment() -> dict[str, str]:
    """This environment; paths of Python's in it are absolute, so that they mean the same wherever the child begins."""
    found = dict(os.environ)
    if paths := [str(Path(path).absolute()) for path in found.pop(_PATH, "").split(os.pathsep) if path]:
        found[_PATH] = os.pathsep.join(paths)
    return found


@contextmanager
def _safe_path() -> Iterator[None]:
    """What multiprocessing starts here gets no working folder on its path; it takes this environment as it is."""
    with _starting:
        before = dict(os.environ)
        safe = {**_environment(), _SAFE_PATH: "1"}
        try:
            _set(safe)
            yield
        finally:
            _set(before)


def _set(environment: Mapping[str, str]) -> None:
    for name in (_PATH, _SAFE_PATH):
        if name in environment:
            os.environ[name] = environment[name]
        else:
            os.environ.pop(name, None)
