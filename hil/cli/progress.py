"""How far a run is: a bar on a terminal, plain lines otherwise."""

from __future__ import annotations

import math
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import IO, TYPE_CHECKING

from hil.printable import printable, raw
from hil.stderr import write

if TYPE_CHECKING:
    from rich.progress import Progress

_STEP = 0.1
EVERY = "HIL_PROGRESS_S"


@contextmanager
def shown(after_s: float = 0.0) -> Iterator[Callable[[float, str], None]]:
    """A function of (share done, text) that shows progress while the context lasts.

    `after_s`: as plain lines only once it has lasted so long, for work that is mostly over sooner.
    """
    if not _is_terminal():
        late = _Late(_while_it_lasts(_plain()), after_s)
        try:
            yield late.tell if after_s else late.show
        finally:
            late.stop()
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
    from rich.table import Column

    description = TextColumn(
        "{task.description}", markup=False, table_column=Column(no_wrap=False, overflow="fold", ratio=1)
    )
    columns = (BarColumn(bar_width=20), TaskProgressColumn(), TimeElapsedColumn(), description)
    screen: IO[str] = _Screen(raw(sys.stderr))  # type: ignore[assignment] # what a console needs of one
    bar = Progress(*columns, console=Console(file=screen, force_terminal=True), transient=True, expand=True)
    bar.start()
    _bars.append(bar)
    try:
        task = bar.add_task("", total=1.0)
        yield _while_it_lasts(lambda done, text: bar.update(task, completed=done, description=printable(text)))
    finally:
        clear()


_bars: list[Progress] = []


def clear() -> None:
    """Take the bar off the terminal: something else is to be said there."""
    while _bars:
        with suppress(OSError, ValueError):  # a terminal that is gone takes the place of no other error
            _bars.pop().stop()


class _Screen:
    """A terminal on which only that appears what it takes at once: one that is stopped (Ctrl-S) holds up no run."""

    def __init__(self, stream: IO[str]) -> None:
        self._stream = stream
        self.encoding = getattr(stream, "encoding", "utf-8")

    def write(self, text: str) -> int:
        write(text, 0.0, self._stream)
        return len(text)

    def flush(self) -> None:
        """Nothing is kept back."""

    def fileno(self) -> int:
        return self._stream.fileno()

    def isatty(self) -> bool:
        return True


def _is_terminal() -> bool:
    try:
        return sys.stderr.isatty()
    except (AttributeError, ValueError):  # closed
        return False


def _while_it_lasts(show: Callable[[float, str], None]) -> Callable[[float, str], None]:
    """Nothing more is shown once nobody can see it: a terminal that is gone ends no run."""
    gone = False

    def show_or_not(done: float, text: str) -> None:
        nonlocal gone
        if not gone:
            try:
                show(done, text)
            except (OSError, ValueError):
                gone = True

    return show_or_not


class _Late:
    """Shows nothing at first, then what was told last, then each thing that is told."""

    def __init__(self, show: Callable[[float, str], None], after_s: float) -> None:
        self.show = show
        self._lock, self._last, self._begun = threading.Lock(), (0.0, "working"), False
        self._timer = threading.Timer(after_s, self._begin)
        self._timer.daemon = True
        if after_s:
            self._timer.start()

    def tell(self, done: float, text: str) -> None:
        with self._lock:
            self._last = done, text
            if self._begun:
                self.show(done, text)

    def stop(self) -> None:
        """Show nothing more."""
        self._timer.cancel()

    def _begin(self) -> None:
        with self._lock:
            self._begun = True
            self.show(*self._last)


def _plain() -> Callable[[float, str], None]:
    """A line on stderr each time another tenth is done, and as often as `HIL_PROGRESS_S` asks."""
    every_s = _interval_s()
    last, last_s = -1.0, -math.inf

    def show(done: float, text: str) -> None:
        nonlocal last, last_s
        if last >= 1.0 > done:  # another piece of work begins
            last = -1.0
        now_s = time.monotonic()
        if done >= last + _STEP or (done >= 1.0 > last) or now_s - last_s >= every_s:
            write(f"{done:4.0%}  {text}\n", 0.0)
            last, last_s = done, now_s

    return show


def _interval_s() -> float:
    """Seconds between two lines; infinity where nobody asks."""
    try:
        return max(0.1, float(os.environ.get(EVERY, "")))
    except ValueError:
        return math.inf
