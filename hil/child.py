"""Processes of our own: the one place where this program starts another.

Nothing that lies in a working folder is executed in one: `-P` keeps that folder off the path where Python looks for
modules, and an empty entry of PYTHONPATH, which means the same folder, is left out.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

Process = subprocess.Popen
PIPE, TimeoutExpired = subprocess.PIPE, subprocess.TimeoutExpired

_PATH, _SAFE_PATH = "PYTHONPATH", "PYTHONSAFEPATH"
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


def over_processes(function: Callable[[_Item], _Found], items: Sequence[_Item], workers: int) -> Iterator[_Found]:
    """`map(function, items)`, each in one of some processes; in order, as they are finished."""
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    with _safe_path():  # processes start when the pool is made and while it takes the work
        pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"))
        answers = pool.map(function, items)
    with pool:
        yield from answers


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
