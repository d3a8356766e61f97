"""What a console knows while it runs: none of it is needed by a run."""

from __future__ import annotations

import itertools
import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from starlette.requests import Request

from hil.bench.stop.press import Press, StopSwitch
from hil.console.board import RunReader
from hil.console.follow import Following
from hil.console.leaving import Leaving
from hil.console.process import Started, start
from hil.console.site import Site
from hil.console.underway import Run, Underway
from hil.console.watching import Watching
from hil.errors import SettingError
from hil.record.run_folder.header import END_FILE

_MOST_STARTED = 50
_JOBS_IN_PARALLEL = 2  # each takes what processors there are
_MOST_WAITING = 20
_SHOWN_S = 3.0  # so long a run that ended while it started is still told


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
        stopped: those of these that a press of stop has ended, and that press.
        audit: told of each act that moves an output, resets a trip or overrides a limit: (request, act, details, and
            the operator's name as typed).
        readers: of the board, by run.
        products: by job, where its product is found.
        waiting: jobs that are not started yet, the first first: the arguments of `hil` and the account, by job.
    """

    site: Site
    underway: Underway
    following: Following = field(default_factory=Following)
    watching: Watching = field(default_factory=Watching)
    started: dict[str, Started] = field(default_factory=dict)
    starting: dict[str, Started] = field(default_factory=dict)
    stopped: dict[str, Press] = field(default_factory=dict)
    audit: Callable[..., None] = lambda *_args, **_named: None
    readers: dict[str, RunReader] = field(default_factory=dict)
    products: dict[str, str] = field(default_factory=dict)
    waiting: dict[str, tuple[list[str], str]] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _numbers: itertools.count[int] = field(default_factory=lambda: itertools.count(1))

    @classmethod
    def of(cls, request: Request) -> Console:
        """The console of a request."""
        return request.app.state.console

    def new_name(self, kind: str) -> str:
        """A name for a process of a kind, unlike any other."""
        return f"{kind}-{datetime.now(UTC):%Y%m%dT%H%M%S}-{next(self._numbers)}"

    def start(self, arguments: list[str], name: str, account: str = "") -> Started:
        """Start `hil ARGUMENTS…` under a name, for an account."""
        made = self.started[name] = start(name, arguments, self.log(name), account, self.site.place)
        ended = [key for key, one in self.started.items() if one.exit_status is not None]
        for key in ended[: max(0, len(self.started) - _MOST_STARTED)]:
            del self.started[key]
            self.stopped.pop(key, None)
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

    @property
    def switch(self) -> StopSwitch:
        """Stop, as it is pressed for the folder of runs."""
        return StopSwitch(self.site.runs)

    def begin_run(self, arguments: list[str], name: str, account: str) -> None:
        """Start a run: it is under way from here on. A stop that was pressed just before ends it."""
        self.starting[name] = self.start(arguments, name, account)
        if (press := self.switch.pressed) is not None:
            self.end_starting(name, press)

    def end_starting(self, name: str, press: Press) -> None:
        """End a run before it drives, by a press of stop."""
        self.stopped[name] = press
        self.starting[name].end()

    def runs(self, anew: bool = False) -> list[dict[str, Any]]:
        """Every run under way as pages are told of it, from the click that starts it; `anew`: as of now."""
        by_name = {run.folder.name: run.for_page for run in self.underway.look(anew)}
        for name, one in list(self.starting.items()):
            status = one.exit_status
            if status is not None:
                one.over_s = one.over_s or time.monotonic()
            has_driven = (self.site.runs / name / END_FILE).exists()  # it may still look for a cause
            has_begun = "stop_url" in by_name.get(name, {}) or has_driven
            if has_begun or time.monotonic() - (one.over_s or math.inf) > _SHOWN_S:
                del self.starting[name]
                continue
            state = "starting" if status is None else "ended"
            outcome = "" if status is None else one.last_line
            by_name.setdefault(name, {"run": name, "state": state, "outcome": outcome})["by"] = "console"
        return list(by_name.values())

    def begin_job(self, arguments: list[str], name: str, product: str, account: str = "") -> None:
        """Start a job as soon as fewer than two are at work.

        Args:
            arguments: of `hil`.
            name: of the job.
            product: the address at which its product is found when it has ended well.
            account: for which it works.

        Raises:
            SettingError: too many wait.
            StorageError: its log cannot be written.
        """
        if len(self.waiting) >= _MOST_WAITING:
            raise SettingError(f"{_MOST_WAITING} jobs wait already; try again when some are done")
        self.waiting[name], self.products[name] = (arguments, account), product
        self._start_jobs()

    def _start_jobs(self) -> None:
        with self._lock:
            while self.waiting and sum(self._works(name) for name in self.products) < _JOBS_IN_PARALLEL:
                name = next(iter(self.waiting))
                arguments, account = self.waiting.pop(name)
                self.start(arguments, name, account)

    def _works(self, job: str) -> bool:
        made = self.started.get(job)
        return made is not None and made.exit_status is None

    def tick(self) -> None:
        """Start jobs that waited, and release a stop that was pressed for runs that are over."""
        self._start_jobs()
        self.runs()
        press = self.switch.pressed
        if press and press.runs and not any(name in self.starting for name in press.runs):
            self.switch.release()

    def leave(self) -> Leaving:
        """End the runs that were started here; jobs are not waited for."""
        return Leaving({self.site.runs / name: one for name, one in self.started.items() if name not in self.products})

    def close(self) -> None:
        """Let go of what reads, and of who looks on; runs go on."""
        self.following.close()
        self.watching.close()
