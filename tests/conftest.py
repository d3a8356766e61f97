"""Fixtures that every kind of test may use."""

from __future__ import annotations

import gc
import io
import os
import signal
import threading
from collections.abc import Callable, Generator, Mapping
from pathlib import Path
from typing import IO, Any, NamedTuple

import platformdirs
import pytest
from hypothesis import settings

from hil.catalog import entries
from tests.once import SHARED

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the console script does, before numpy is imported

if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("HIL_CORES", "1")  # the cores are busy: threads would wait for each other

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None)  # HYPOTHESIS_PROFILE=explore: other examples each time
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))

STRANGER = Path(__file__).parent / "stranger"


def pytest_configure() -> None:
    """Hear the keyboard even where a shell that runs things in the background has it ignored: programs inherit that."""
    usual_of = dict.fromkeys(
        (signal.SIGQUIT, signal.SIGHUP, signal.SIGTERM), signal.SIG_DFL
    )  # nohup ignores the second
    for number, usual in {signal.SIGINT: signal.default_int_handler, **usual_of}.items():
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, usual)
    gc.disable()  # the tests that are collected stay to the end: to look through them for garbage is a quarter of it


def pytest_collection_finish() -> None:
    """Tests and the modules that they import stay to the end: no search for garbage need look at them again."""
    gc.freeze()
    gc.enable()
    gc.set_threshold(20_000, 10, 10)  # as the console script does


@pytest.fixture(autouse=True)
def signals():
    """A program that was called within a test, not started, leaves signals ignored as at its end: give them back."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1)
    before = {number: signal.getsignal(number) for number in numbers}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture(autouse=True)
def devices_are_closed():
    """What keeps a device alive ends with it: one left open would go on driving beside the tests that follow."""
    before = set(threading.enumerate())
    yield
    for thread in set(threading.enumerate()) - before:
        if thread.name == "hil-keep-alive":
            thread.join(5.0)
            assert not thread.is_alive(), "a device that this test opened is still kept alive: close it"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """With HIL_TEST_ALL=1, as in CI, a test that is skipped has failed: nobody would miss it otherwise."""
    report = yield
    if os.environ.get("HIL_TEST_ALL") == "1" and report.skipped and not hasattr(report, "wasxfail"):
        report.outcome, report.longrepr = "failed", f"{item.nodeid} was skipped: {_why(report)}"
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """The same for a module or class that is skipped as a whole."""
    report = yield
    if os.environ.get("HIL_TEST_ALL") == "1" and report.skipped:
        report.outcome, report.longrepr = "failed", f"{collector.nodeid} was skipped: {_why(report)}"
    return report


def _why(report: pytest.TestReport | pytest.CollectReport) -> str:
    return str(report.longrepr[-1] if isinstance(report.longrepr, tuple) else report.longrepr)


@pytest.fixture(scope="session", autouse=True)
def state(tmp_path_factory):
    """Trips and leases of the tests are their own, not the user's, and not those of tests beside them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HIL_STATE_DIR", str(tmp_path_factory.mktemp("state")))
        patch.setenv("HIL_ARCHIVE", str(tmp_path_factory.mktemp("archive")))
        own = tmp_path_factory.getbasetemp()
        patch.setenv(SHARED, str(own.parent if "PYTEST_XDIST_WORKER" in os.environ else own))
        # Programs that tests start in a home of their own need not compile every plant anew.
        patch.setenv("HIL_CACHE_DIR", os.environ.get("HIL_CACHE_DIR") or platformdirs.user_cache_dir("valve-hil"))
        yield


@pytest.fixture
def read_text(tmp_path):
    """What is read of a file of this text, or of these bytes."""

    def read(text, reading=None, name="x.csv"):
        from hil.record.read import read_recording

        (tmp_path / name).write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_recording(tmp_path / name, reading)

    return read


@pytest.fixture
def own_state(tmp_path, monkeypatch):
    """Trips, leases, keys and the audit trail of this test alone, in `tmp_path`/state."""
    monkeypatch.setenv("HIL_STATE_DIR", str(tmp_path / "state"))


@pytest.fixture
def half_a_second_later(monkeypatch):
    """Called, a device is asked at each reading where its outputs stand, as it is after half a second."""
    from hil.daq.device_link import ReadBackTimes

    return lambda: monkeypatch.setattr(ReadBackTimes, "is_due", lambda *_: True)


@pytest.fixture
def stranger(monkeypatch):
    """A stranger's package of procedures, installed for one test; yields the folder that brings it along."""
    monkeypatch.syspath_prepend(str(STRANGER))
    entries.cache_clear()
    yield STRANGER
    entries.cache_clear()


class Told(NamedTuple):
    """How a command ended, and what it wrote since the one before."""

    status: int
    out: str
    err: str


@pytest.fixture
def command_line(monkeypatch, capsys):
    """Runs `hil …` within this process; `typed` is what it reads from the keyboard."""

    def run(*arguments: object, typed: str = "") -> Told:
        from hil.__main__ import main

        monkeypatch.setattr("sys.argv", ["hil", *map(str, arguments)])
        monkeypatch.setattr("sys.stdin", io.StringIO(typed))
        with pytest.raises(SystemExit) as ended:
            main()
        return Told(int(ended.value.code or 0), *capsys.readouterr())

    return run


@pytest.fixture
def prints(command_line):
    """What a command prints that ends well."""

    def run(*words):
        ended = command_line(*words)
        assert ended.status == 0, ended.err
        return ended.out

    return run


@pytest.fixture
def refused(command_line):
    """The one line in which a command says what is wrong with its input."""

    def run(*words):
        ended = command_line(*words)
        assert ended.status == 2 and ended.err.startswith("hil: ") and ended.err.count("\n") == 1, ended
        return ended.err

    return run


@pytest.fixture(scope="module")
def unprinted():
    """Drawings of a module are filled as ever, and not printed: that is most of a run whose numbers alone count."""
    from matplotlib.figure import Figure

    def blank(_figure: Figure, file: IO[Any], **_: object) -> None:
        alone = b'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 8 4"></svg>'  # a file of its own, in a passport
        file.write(alone if isinstance(file, io.BytesIO) else '<svg viewBox="0 0 8 4"></svg>')

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hil.report.figure.lay_out", lambda _figure: None)
        patch.setattr(Figure, "savefig", blank)
        yield


Install = Callable[[str, str, Mapping[str, str]], None]


@pytest.fixture
def install_package(tmp_path, monkeypatch):
    """Installs a stranger's package for one test: group of its entry point, name, files and their text."""

    def installed(group: str, package: str, files: Mapping[str, str]) -> None:
        folder = tmp_path / package
        folder.mkdir()
        for name, text in {"__init__.py": '"""A stranger\'s package."""\n', **files}.items():
            (folder / name).write_text(text, encoding="utf-8")
        about = tmp_path / f"{package}-1.0.dist-info"
        about.mkdir()
        (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n", encoding="utf-8")
        (about / "entry_points.txt").write_text(f"[{group}]\n{package} = {package}\n", encoding="utf-8")
        monkeypatch.syspath_prepend(str(tmp_path))
        _forget()

    _forget()
    yield installed
    _forget()


def _forget() -> None:
    from hil.physics.compose import effects, kernel, plant  # numpy comes with it

    for remembered in (entries, effects, kernel, plant):
        remembered.cache_clear()


@pytest.fixture(scope="session")
def postgresql():
    """The address of a PostgreSQL server of this worker's own."""
    from tests.postgres import served, server_programs

    programs = server_programs()
    if programs is None:
        pytest.skip("no PostgreSQL server is installed (apt-get install postgresql)")
    with served(programs) as url:
        yield url


@pytest.fixture(params=["sqlite", "postgresql"])
def place(request, tmp_path):
    """An empty archive, in either database."""
    from hil.archive.place import archive_place
    from tests.postgres import new_database

    if request.param == "sqlite":
        return archive_place(str(tmp_path / "lab"))
    return archive_place(new_database(request.getfixturevalue("postgresql")))
