"""What a console knows while it runs: none of it is needed by a run."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from starlette.requests import Request

from hil.console.board import RunReader
from hil.console.follow import Following
from hil.console.process import Started, start
from hil.console.site import Site
from hil.console.underway import Run, Underway
from hil.console.watching import Watching

_MOST_STARTED = 50


@dataclass(slots=True)
class Starting:
    """A run from the click on: its process, and since when that is over."""

    process: Started
    over_s: float | None = None


@dataclass(slots=True)
class Console:
    """A console.

    Attributes:
        site: what may be shown and started.
        underway: finds runs that are not closed.
        following: reads them for all viewers.
        watching: reads inputs while no run drives.
        started: processes that were started here, by the name by which pages speak of them.
        starting: runs among them that nobody could stop yet at a listener of their own, by name.
        audit: told of each act that moves an output, resets a trip or overrides a limit: (request, act, details).
        readers: of the board, by run.
        products: by job, where its product is found.
    """

    site: Site
    underway: Underway
    following: Following = field(default_factory=Following)
    watching: Watching = field(default_factory=Watching)
    started: dict[str, Started] = field(default_factory=dict)
    starting: dict[str, Starting] = field(default_factory=dict)
    audit: Callable[[Request, str, Mapping[str, Any]], None] = lambda _request, _act, _details: None
    readers: dict[str, RunReader] = field(default_factory=dict)
    products: dict[str, str] = field(default_factory=dict)
    _numbers: itertools.count[int] = field(default_factory=lambda: itertools.count(1))

    @classmethod
    def of(cls, request: Request) -> Console:
        """The console of a request."""
        found: Console = request.app.state.console
        return found

    def new_name(self, kind: str) -> str:
        """A name for a process of a kind, unlike any other."""
        return f"{kind}-{datetime.now(UTC):%Y%m%dT%H%M%S}-{next(self._numbers)}"

    def start(self, arguments: list[str], name: str) -> Started:
        """Start `hil ARGUMENTS…` under a name."""
        made = self.started[name] = start(name, arguments, self.log(name))
        ended = [key for key, one in self.started.items() if one.exit_status is not None]
        for key in ended[: max(0, len(self.started) - _MOST_STARTED)]:
            del self.started[key]
        return made

    def log(self, name: str) -> Path:
        """Where a process of that name says what it says."""
        return self.site.state / "logs" / f"{name}.log"

    def pid(self, run: str) -> int | None:
        """The process of a run that was started here."""
        found = self.started.get(run)
        return found.process.pid if found else None

    def run_on(self, bench: str) -> Run | None:
        """The run that drives the bench of that title now; the newest, where a simulated one has several."""
        driving = [run for run in self.underway.look() if run.meta.get("bench") == bench and run.state == "running"]
        return driving[-1] if driving else None

    def close(self) -> None:
        """Let go of what reads, and of who looks on; runs and devices go on."""
        self.following.close()
        self.watching.close()
