"""How far a run is: a bar on a terminal, plain lines otherwise."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_STEP = 0.1


@contextmanager
def shown() -> Iterator[Callable[[float, str], None]]:
    """A function of (share done, text) that shows progress while the context lasts."""
    if not sys.stderr.isatty():
        yield _plain()
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    columns = (BarColumn(), TaskProgressColumn(), TimeElapsedColumn(), TextColumn("{task.description}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda done, text: bar.update(task, completed=done, description=text)


def _plain() -> Callable[[float, str], None]:
    """A line on stderr each time another tenth is done."""
    last = -1.0

    def show(done: float, text: str) -> None:
        nonlocal last
        if done >= last + _STEP or (done >= 1.0 > last):
            print(f"{done:4.0%}  {text}", file=sys.stderr, flush=True)
            last = done

    return show
