"""An end is final, whatever the procedure does with it, and nobody waits for the procedure."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil.bench.find import benches
from hil.bench.read import BenchFile, read_bench
from hil.errors import HilError, RangeError, StoppedError, StorageError, TrippedError, with_notes
from hil.record.measurement import Findings
from hil.record.recording import Array, Recording
from hil.rig import Rig
from hil.safety.outputs import Outputs
from hil.session.procedure import Procedure
from hil.session.run import run_procedure
from tests.driven import silent_rig
from tests.once import once

pytestmark = pytest.mark.usefixtures("unprinted")

TRIPS = '\n[interlocks.too-much]\nchannel = "flow"\nhigh = 40.0\naction = "trip"\n'
SWALLOWED: tuple[type[BaseException], ...] = (BaseException,)
Act = Callable[[Rig], object]


def bench(tmp_path: Path, more: str = "") -> BenchFile:
    path = tmp_path / "bench.toml"
    path.write_text(benches()["brevini-hpv41"].read_text(encoding="utf-8") + more, encoding="utf-8")
    return read_bench(path)


def procedure(run: Callable[..., None]) -> Procedure:
    return Procedure("stubborn", "", run, lambda _recording: Findings(()), {}, ())


def hold(rig: Rig, level: float = 20.0) -> Recording:
    return rig.play(np.full(100, level))


def ended(tmp_path: Path, act: Act, more: str = "") -> tuple[BaseException, dict[str, Any], list[BaseException]]:
    """What a run ends with, its record as it stood when the procedure went on, and what later calls raised."""
    record: dict[str, Any] = {}
    later: list[BaseException] = []

    def run(rig: Rig) -> None:
        hold(rig)
        try:
            act(rig)
        except SWALLOWED:
            record.update(json.loads((tmp_path / "run" / "end.json").read_text()))
        calls = (
            lambda: hold(rig, 50.0), lambda: list(rig.stream([np.full(50, 50.0)])), lambda: rig.hold(0.1),
            lambda: rig.ramp_to(30.0), lambda: rig.note("on"), lambda: rig.progress(0.5, "on"), lambda: rig.check(
                np.zeros(3)), lambda: rig.tighten(-50.0, 50.0), lambda: rig.expect(1.0),
        )  # fmt: skip
        for call in calls:
            try:
                call()
            except SWALLOWED as error:
                later.append(error)

    known = Outputs()
    with pytest.raises(SWALLOWED) as raised:
        run_procedure(procedure(run), bench(tmp_path, more), {}, tmp_path / "run", output_states=known)
    assert known.settled
    assert len(later) == 9 and all(error is raised.value for error in later), later
    return raised.value, record, later


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signal_that_a_procedure_swallows_ends_the_run(number, tmp_path):
    error, record, _ = ended(tmp_path, lambda _rig: signal.raise_signal(number))
    assert isinstance(error, KeyboardInterrupt)
    assert "outputs are safe (read back)" in with_notes(error)
    assert record["outcome"].startswith(type(error).__name__)


def test_trip_that_a_procedure_swallows_ends_the_run(tmp_path):
    error, record, _ = ended(tmp_path, lambda rig: rig.ramp_to(80.0), TRIPS)
    assert isinstance(error, TrippedError)
    assert record["outcome"].startswith("TrippedError: interlock 'too-much'")


def swallowed_by_commands(rig: Rig) -> None:
    def commands() -> Iterator[Array]:
        for _ in range(20):
            with suppress(BaseException):
                signal.raise_signal(signal.SIGINT)
            yield np.full(50, 40.0)

    list(rig.stream(commands()))


def between_two_pieces(rig: Rig) -> None:
    for _ in rig.stream(np.full(50, 40.0) for _ in range(20)):
        signal.raise_signal(signal.SIGINT)


def ignored_until_the_next_call(rig: Rig) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    hold(rig)
    signal.raise_signal(signal.SIGINT)


@pytest.mark.parametrize("act", [swallowed_by_commands, between_two_pieces, ignored_until_the_next_call])
def test_signal_ends_the_run_wherever_it_comes(act, tmp_path):
    assert isinstance(ended(tmp_path, act)[0], KeyboardInterrupt)


def test_record_that_cannot_be_written_ends_the_run(tmp_path, monkeypatch):
    def full(*_, **__):
        raise StorageError("no space left")

    def act(rig):
        monkeypatch.setattr("hil.record.run_folder.samples.RowsWriter.append", full)
        hold(rig)

    error, record, _ = ended(tmp_path, act)
    assert isinstance(error, StorageError) and record["outcome"].startswith("StorageError")


def test_run_in_a_thread_of_the_procedure_ends_there_too(tmp_path):
    seen = []

    def act(rig):
        def drive():
            try:
                while True:
                    hold(rig)
                    at_work.set()
            except SWALLOWED as error:
                seen.append(error)

        at_work = threading.Event()
        thread = threading.Thread(target=drive)
        thread.start()
        assert at_work.wait(600.0)
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            thread.join(600.0)
            assert not thread.is_alive()

    error, _, _ = ended(tmp_path, act)
    assert seen == [error]


def test_what_is_refused_before_its_first_sample_is_no_end(tmp_path):
    with silent_rig(bench(tmp_path), tmp_path / "run") as rig:
        with pytest.raises(RangeError):
            hold(rig, 900.0)
        assert len(hold(rig)) == 100


def test_reader_who_leaves_a_stream_may_go_on(tmp_path):
    with silent_rig(bench(tmp_path), tmp_path / "run") as rig:
        stream = rig.stream(np.full(50, 40.0) for _ in range(20))
        next(iter(stream))
        stream.close()  # type: ignore[attr-defined] # it is a generator
        assert len(hold(rig)) == 100


def leave_by(error: BaseException, tmp_path: Path) -> None:
    with silent_rig(bench(tmp_path), tmp_path / "run") as rig:
        hold(rig)
        raise error


@pytest.mark.parametrize("error", [GeneratorExit(), ValueError("of the procedure"), StopIteration(), MemoryError()])
def test_error_of_the_procedure_itself_closes_the_record(error, tmp_path):
    with pytest.raises((type(error), RuntimeError)):
        leave_by(error, tmp_path)
    assert type(error).__name__ in json.loads((tmp_path / "run" / "end.json").read_text())["outcome"]


def test_procedure_that_calls_sys_exit_is_named(tmp_path):
    def run(rig):
        hold(rig)
        sys.exit(0)

    with pytest.raises(StoppedError, match=r"^procedure 'stubborn' called sys\.exit\(0\); the run was stopped"):
        run_procedure(procedure(run), bench(tmp_path), {}, tmp_path / "run")


def fork_within(tmp_path: Path, pipe: int) -> None:
    with silent_rig(bench(tmp_path), tmp_path / "run") as rig:
        hold(rig)
        if not (child := os.fork()):
            try:
                hold(rig)
            except HilError as error:
                os.write(pipe, str(error).encode())
            os._exit(0)
        os.waitpid(child, 0)
        hold(rig)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_forked_child_drives_nothing_and_the_run_goes_on(tmp_path):
    near, far = os.pipe()
    fork_within(tmp_path, far)
    os.close(far)
    with os.fdopen(near, "rb") as told_by_child:
        assert told_by_child.read() == b"this process was forked from a run; only the run itself drives its bench"
    assert json.loads((tmp_path / "run" / "end.json").read_text())["outcome"] == "completed"


COMMAND = """
import os, signal, sys, time
import alembic.command, hil.archive.archive
import numpy as np
from pathlib import Path
from hil.bench import ending
from hil.bench.find import benches
from hil.bench.read import read_bench
from hil.cli.run_end import ended
from hil.record.measurement import Findings
from hil.session.procedure import Procedure
from hil.session.run import run_procedure
import typer

ending.LEAVES_S = 0.3
file, folder = read_bench(benches()["brevini-hpv41"]), Path(sys.argv[1])

def run_as(stubborn):
    def run(rig):
        swallowed = 0
        if stubborn == "leaves":
            rig.play(np.full(100, 20.0))
            os._exit(0)
        while True:
            try:
                rig.play(np.full(100, 20.0))
                if not swallowed:
                    signal.raise_signal(signal.SIGTERM)
            except BaseException:
                swallowed += 1
                if stubborn == "sleeps":
                    while True:
                        try: time.sleep(60.0)
                        except BaseException: pass
                if stubborn == "returns": return
                if stubborn == "raises": raise ValueError("mine")
                if stubborn == "exits": sys.exit(0)
                if stubborn == "forks" and os.fork() == 0: return
    procedure, out = Procedure("stubborn", "", run, lambda _recording: Findings(()), {}, ()), folder / stubborn / "run"
    try:
        ended(lambda known: run_procedure(procedure, file, {}, out, output_states=known), out, str(out.parent))
    except typer.Exit as left:
        sys.exit(left.exit_code)

plain = Procedure("plain", "", lambda rig: rig.play(np.full(10, 20.0)), lambda _recording: Findings(()), {}, ())
run_procedure(plain, file, {}, folder / "plain")  # what it compiles and imports, its forks have
for stubborn in sys.argv[2:]:
    if (child := os.fork()) == 0:
        os.dup2(os.open(folder / (stubborn + ".err"), os.O_WRONLY | os.O_CREAT), 2)
        run_as(stubborn)
        sys.exit(0)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


LEAKED = """
import sys
import numpy as np
from hil import api
opened = api.open_bench("brevini-hpv41", sys.argv[1])
opened.__enter__().play(np.full(100, 20.0))
"""


def test_bench_that_is_never_left_is_closed_when_the_program_ends(tmp_path):
    left = subprocess.run(
        [sys.executable, "-P", "-c", LEAKED, str(tmp_path / "run")], capture_output=True, text=True, timeout=300.0,
        check=False, env={**os.environ, "HIL_STATE_DIR": str(tmp_path / "state")},
    )  # fmt: skip
    assert left.returncode == 0 and not left.stderr, left.stderr
    end = json.loads((tmp_path / "run" / "end.json").read_text())
    assert end["outcome"].startswith("StoppedError: the program ended, and its bench was still open")
    assert end["meta"]["outputs"]["command"]["state"] == "safe"


STUBBORN = ("leaves", "sleeps", "again", "returns", "raises", "exits", "forks")
Endings = dict[str, tuple[int, str, Path]]


@pytest.fixture(scope="module")
def endings(tmp_path_factory):
    """How a program ended with each procedure, what it said and its folder: forks of one that has imported all."""

    def ended_each():
        folder = tmp_path_factory.mktemp("stubborn")
        done = subprocess.run(
            [sys.executable, "-P", "-c", COMMAND, str(folder), *STUBBORN], stdout=subprocess.PIPE, text=True,
            timeout=1800.0, check=True, env={**os.environ, "HIL_STATE_DIR": str(folder / "state")},
        )  # fmt: skip
        statuses = map(int, done.stdout.split())
        return {
            one: (status, (folder / f"{one}.err").read_text(), folder / one)
            for one, status in zip(STUBBORN, statuses, strict=True)
        }

    return once("stubborn", ended_each)


def test_procedure_that_leaves_by_itself_has_not_done_its_work(endings):
    assert endings["leaves"][0] == 3


@pytest.mark.parametrize("stubborn", STUBBORN[1:])
def test_command_leaves_with_the_status_of_the_end(stubborn, endings):
    status, text, folder = endings[stubborn]
    assert status == 128 + signal.SIGTERM, text
    said = [line for line in text.splitlines() if line.startswith("hil: ")]
    kept = f"what was recorded is kept in {folder / 'run'}"
    assert said == [f"hil: stopped; outputs are safe (read back); {kept}"], text
    assert json.loads((folder / "run" / "end.json").read_text())["outcome"].startswith("Terminated: SIGTERM")
