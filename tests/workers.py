"""`pytest --workers N`: tests are collected once, then run by N forks of the process that has collected them.

Workers of pytest-xdist import and collect every test file each for itself: a fifth of the suite. Tests marked
`together` keep to one worker in their order, so that what they make once is made once; all others are taken in the
order of their files, and who has none left takes half of what the busiest has.
"""

from __future__ import annotations

import atexit
import itertools
import os
from collections import deque
from collections.abc import Iterator
from multiprocessing import connection, get_context
from typing import Any

import pytest

from tests.once import SHARED

FORK = get_context("fork")
Unit = list[int]
"""Indices of tests that one worker runs one after the other."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--workers", type=int, default=0, help="run tests by so many forks of this process")


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> bool | None:
    """Hand tests to workers until none is left."""
    count = min(session.config.option.workers, len(session.items))
    if count < 1 or session.testsfailed or session.config.option.collectonly:
        return None
    os.environ[SHARED] = str(session.config._tmp_path_factory.getbasetemp())  # type: ignore[attr-defined]
    workers = [Worker(session, number) for number in range(count)]
    for unit, worker in zip(_grouped(session.items), itertools.cycle(workers)):
        worker.left.append(unit)
    single = [[index] for index, item in enumerate(session.items) if not item.get_closest_marker("together")]
    for number, worker in enumerate(workers):
        worker.left += single[len(single) * number // count : len(single) * (number + 1) // count]
    try:
        for worker in workers:
            worker.start(workers)
        while busy := {worker.pipe: worker for worker in workers if worker.pipe}:
            for ready in connection.wait(list(busy)):
                busy[ready].heard(workers)  # type: ignore[index]
            if stop := session.shouldfail or session.shouldstop:
                raise session.Failed(stop)
        assert sum(worker.done for worker in workers) == len(session.items), "not every test was run"
    finally:
        for worker in workers:
            worker.end(at_once=True)
    return True


def _grouped(items: list[pytest.Item]) -> list[Unit]:
    """Groups of tests that are marked `together`, the largest first: those that wait for clocks begin at once."""
    groups: dict[str, Unit] = {}
    for index, item in enumerate(items):
        if marker := item.get_closest_marker("together"):
            groups.setdefault(marker.args[0], []).append(index)
    return sorted(groups.values(), key=len, reverse=True)


class Worker:
    """One fork at a time, and the tests that wait for it."""

    def __init__(self, session: pytest.Session, number: int) -> None:
        self.session, self.number = session, number
        self.left: deque[Unit] = deque()
        self.given: deque[int] = deque()
        self.done = 0
        self.pipe: connection.Connection | None = None

    def start(self, workers: list[Worker]) -> None:
        """Fork; the fork keeps no line of the others open, so that it sees when this process has gone."""
        self.pipe, far = FORK.Pipe()
        lines = [worker.pipe for worker in workers if worker.pipe]
        self.process = FORK.Process(target=_run, args=(self.session, self.number, far, lines))
        self.process.start()
        far.close()

    def heard(self, workers: list[Worker]) -> None:
        """Answer a question for tests, or pass on what has become of one."""
        assert self.pipe
        try:
            what, told = self.pipe.recv()
        except (EOFError, ConnectionError):
            return self._gone(workers)
        hook = self.session.config.hook
        if what == "more":
            unit = self._next(workers)
            self.given += unit
            self.pipe.send(unit)
        elif what == "report":
            hook.pytest_runtest_logreport(
                report=hook.pytest_report_from_serializable(config=self.session.config, data=told)
            )
        else:
            self._past()
            hook.pytest_runtest_logfinish(nodeid=told[0], location=told[1])
        return None

    def _past(self) -> pytest.Item:
        self.done += 1
        return self.session.items[self.given.popleft()]

    def _next(self, workers: list[Worker]) -> Unit:
        if not self.left:
            busiest = max(workers, key=lambda worker: len(worker.left))
            taken = [busiest.left.pop() for _ in range((len(busiest.left) + 1) // 2)]
            self.left.extend(reversed(taken))
        return self.left.popleft() if self.left else []

    def _gone(self, workers: list[Worker]) -> None:
        """A fork that died has failed the test it ran; another goes on with the rest."""
        self.end()
        if not self.given:
            assert not self.process.exitcode, "what tests of a worker had in common did not end as it should"
            return
        item = self._past()
        told = f"a worker ended with {self.process.exitcode} within {item.nodeid}"
        failed = pytest.TestReport(item.nodeid, item.location, {}, "failed", told, "call")
        self.session.config.hook.pytest_runtest_logreport(report=failed)
        if self.given:
            self.left.appendleft(list(self.given))
            self.given.clear()
        self.start(workers)

    def end(self, *, at_once: bool = False) -> None:
        """Wait for the fork to end, which has closed its line, or make it end."""
        if self.pipe:
            if at_once:
                self.process.terminate()
            self.process.join()
            self.pipe.close()
            self.pipe = None


class _Beside:
    """In place of a next test, which is not known yet: what a test has in common with those beside it is kept."""

    def __init__(self, item: pytest.Item) -> None:
        self.item = item

    def listchain(self) -> list[Any]:
        return self.item.listchain()[:-1]


class _Told:
    """In place of the terminal: the process that started this one."""

    def __init__(self, config: pytest.Config, pipe: connection.Connection) -> None:
        self.config, self.pipe = config, pipe

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        data = self.config.hook.pytest_report_to_serializable(config=self.config, report=report)
        self.pipe.send(("report", data))

    def pytest_runtest_logfinish(self, nodeid: str, location: Any) -> None:
        self.pipe.send(("end", (nodeid, location)))


def _run(session: pytest.Session, number: int, pipe: connection.Connection, lines: list[connection.Connection]) -> None:
    """Run what the process that forked this one hands out, with files and captured output of its own."""
    for line in lines:
        line.close()
    os.environ.setdefault("HIL_CORES", "1")  # the cores are busy: threads would wait for each other
    config = session.config
    plugins = config.pluginmanager
    capture = plugins.getplugin("capturemanager")
    assert capture
    capture.stop_global_capturing()
    capture.start_global_capturing()
    plugins.unregister(name="terminalreporter")
    plugins.register(_Told(config, pipe))
    factory = config._tmp_path_factory  # type: ignore[attr-defined]
    factory._basetemp = factory.getbasetemp() / f"worker-{number}-{os.getpid()}"
    factory._basetemp.mkdir(mode=0o700)
    item: pytest.Item | None = None
    for after in _asked_for(session.items, pipe):
        _part(session, item, after)
        item = after
        config.hook.pytest_runtest_protocol(item=item, nextitem=_Beside(item))
    _part(session, item, None)
    atexit._run_exitfuncs()


def _part(session: pytest.Session, item: pytest.Item | None, after: pytest.Item | None) -> None:
    """End what a test has not in common with the one after it."""
    if item:
        call = pytest.CallInfo.from_call(lambda: session._setupstate.teardown_exact(after), "teardown")
        if call.excinfo:
            report = item.ihook.pytest_runtest_makereport(item=item, call=call)
            item.ihook.pytest_runtest_logreport(report=report)


def _asked_for(items: list[pytest.Item], pipe: connection.Connection) -> Iterator[pytest.Item]:
    try:
        while True:
            pipe.send(("more", None))
            unit = pipe.recv()
            if not unit:
                return
            yield from map(items.__getitem__, unit)
    except (EOFError, ConnectionError):
        return  # the run was broken off
