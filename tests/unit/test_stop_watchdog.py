"""What the watchdog process makes of a stop: it tells the program, waits a moment, and takes over."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from typing import Any

import pytest

from hil.bench import fail_safe_shutdown, watchdog
from hil.bench.stop.control import Control, Tokens, control_of, published
from hil.bench.stop.stop_service import StopService
from hil.safety.outputs import Output, State, outputs_in, record_of
from hil.system.parent import Parent
from tests.stops import SAFE
from tests.unit.test_bench_watchdog import Valve, bench_of
from tests.waits import PATIENCE_S, until

LIMIT_S = 0.6


@dataclass
class Watched:
    """A watchdog that watches over a program that does nothing, and what it said to it."""

    program: subprocess.Popen[bytes]
    reader: Parent[Any]
    pipe: int
    service: StopService
    received: list[bytes] = field(default_factory=list)
    ended: list[tuple[str, float]] = field(default_factory=list)
    threads: list[threading.Thread] = field(default_factory=list)

    def says(self, what: bytes) -> None:
        os.write(self.pipe, what)

    def tells(self, output: Output) -> None:
        self.says(json.dumps({"outputs": record_of({"valve": output})}).encode() + b"\n")

    def begin(self, limit_s: float = PATIENCE_S) -> threading.Thread:
        def watch() -> None:
            end = watchdog.watch_over(self.reader, limit_s, self.program.pid, self.service, {})
            self.ended.append((end, time.monotonic()))

        thread = threading.Thread(target=watch, daemon=True)
        thread.start()
        self.threads.append(thread)
        return thread

    @property
    def was_killed(self) -> bool:
        try:
            return self.program.wait(PATIENCE_S) == -9
        except subprocess.TimeoutExpired:
            return False

    @property
    def lives(self) -> bool:
        return self.program.poll() is None


@pytest.fixture
def watched(monkeypatch):
    with begun(monkeypatch) as made:
        yield made


@contextmanager
def begun(monkeypatch: pytest.MonkeyPatch) -> Iterator[Watched]:
    reading, writing = os.pipe()
    with subprocess.Popen(["sleep", "infinity"]) as program, closing(Parent(program.pid, reading)) as reader:
        made = Watched(program, reader, writing, StopService({"valve": "V"}, "watchdog", reader.request))
        monkeypatch.setattr(reader, "say", made.received.append)
        try:
            yield made
        finally:
            program.kill()
            for thread in made.threads:
                thread.join(PATIENCE_S)
            os.close(writing)
            os.close(reading)


def wait_until_told(watched: Watched) -> None:
    until(lambda: b"!" in watched.received, every_s=0.002)


def test_program_that_does_not_confirm_is_killed_after_a_moment(watched):
    thread, begun_s = watched.begin(), time.monotonic()
    waiting = watched.service.stop()
    watched.says(b"dd")  # it lives, and drives on
    thread.join(PATIENCE_S)
    end, at_s = watched.ended[0]
    assert "did not confirm within 0.2 s" in end
    assert at_s - begun_s > 0.19
    assert watched.received.count(b"!") == 1 and watched.was_killed and not waiting.done()


@pytest.mark.parametrize(
    ("output", "confirmed"), [(SAFE["valve"], True), (Output(State.UNCONFIRMED, "V", can=False), False)]
)
def test_program_that_confirms_or_cannot_ask_its_device_goes_its_own_way(output, confirmed, watched, monkeypatch):
    monkeypatch.setattr(watchdog, "CONFIRMS_S", PATIENCE_S)
    thread = watched.begin()
    waiting = watched.service.stop()
    wait_until_told(watched)
    watched.tells(output)
    assert waiting.result(PATIENCE_S).is_confirmed == confirmed
    watched.says(b"s")
    time.sleep(0.3)
    assert thread.is_alive()
    watched.says(b"q")
    thread.join(PATIENCE_S)
    assert not watched.ended[0][0] and watched.lives


@pytest.mark.parametrize("output", [Output(State.DRIVEN, "V", 5.0), Output(State.UNCONFIRMED, "V", why="no answer")])
def test_program_that_says_it_is_not_safe_is_killed(output, watched):
    thread = watched.begin()
    waiting = watched.service.stop()
    watched.tells(output)
    thread.join(PATIENCE_S)
    assert watched.was_killed and not waiting.done()


def test_program_that_is_confirming_is_left_alone_until_it_hangs(watched):
    watched.says(b"c")
    thread = watched.begin(3.0)
    waiting = watched.service.stop()
    for _ in range(10):  # five times as long as it has to begin
        watched.says(b"c")
        time.sleep(0.1)
    assert watched.lives and not watched.ended
    watched.tells(Output(State.UNCONFIRMED, "V", 0.0, confirmed_in_s=0.5))
    assert not waiting.done()
    thread.join(PATIENCE_S)
    end, _ = watched.ended[0]
    assert "gave no sign of life for 3 s" in end and watched.was_killed


def test_wishes_do_not_keep_a_silent_program_alive(watched):
    thread = watched.begin(LIMIT_S)
    watched.says(b"d")
    while thread.is_alive():
        watched.service.ask_to_hold(True)
        time.sleep(0.05)
    end, _ = watched.ended[0]
    assert "gave no sign of life" in end and watched.was_killed


def test_dead_program_is_noticed_whoever_holds_its_pipe(watched):
    thread = watched.begin()  # the pipe stays open here, as in a child that the program has forked
    watched.says(b"d")
    watched.program.kill()
    thread.join(PATIENCE_S)
    end, _ = watched.ended[0]
    assert end == "ended without making its outputs safe"


def test_program_that_hands_over_is_told_that_it_is_done(watched):
    thread = watched.begin()
    watched.says(b"dh")
    thread.join(PATIENCE_S)
    end, _ = watched.ended[0]
    assert end and watched.lives and watched.received[-1] == b"+"


LISTENS = """
import sys
from hil.bench import watchdog
from hil.system.parent import Parent
from hil.bench.stop.stop_service import StopService
reader = Parent(int(sys.argv[1]))
print("ready", file=sys.stderr, flush=True)
end = watchdog.watch_over(reader, 2.0, int(sys.argv[1]), StopService({}, "watchdog", reader.request), {})
print(end, file=sys.stderr)
"""


def test_watchdog_that_was_paused_believes_what_lies_in_the_pipe():
    with (
        subprocess.Popen(["sleep", "60"]) as program,
        subprocess.Popen(
            [sys.executable, "-P", "-c", LISTENS, str(program.pid)], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, bufsize=0,
        ) as listens,
    ):  # fmt: skip
        assert listens.stdin and listens.stdout and listens.stderr
        assert listens.stderr.readline() == b"ready\n"
        listens.stdin.write(b"d")
        assert listens.stdout.read(1) == b"."
        listens.send_signal(signal.SIGSTOP)
        listens.stdin.write(b"q")  # the program ends well
        time.sleep(2.5)
        listens.send_signal(signal.SIGCONT)
        assert listens.stderr.read() == b"\n" and program.poll() is None
        program.kill()


def test_after_eight_hours_of_signs_of_life_a_stop_is_heard_at_once(watched, monkeypatch):
    monkeypatch.setattr(watchdog, "CONFIRMS_S", PATIENCE_S)
    thread = watched.begin()
    for _ in range(75):  # a sign each 0.1 s
        watched.says(b"d" * 4000)
    waiting = watched.service.stop()
    wait_until_told(watched)
    assert sum(map(len, watched.received)) >= 75 * 4000
    watched.tells(SAFE["valve"])
    assert waiting.result(PATIENCE_S).is_confirmed
    watched.says(b"q")
    thread.join(PATIENCE_S)


def test_program_is_understood_in_whatever_pieces_it_comes():
    told = b"dd" + json.dumps({"holding": True}).encode() + b"\nd" + json.dumps({"outputs": {"valve": {
        "state": "safe", "at": 0.0, "unit": "V", "read_back": True}}}).encode() + b"\nsq"  # fmt: skip
    for size in (1, 2, 3, 7, 1000):
        service = StopService({"valve": "V"}, "watchdog", lambda _wish: None)
        service.ask_to_hold(True)
        program = watchdog.WatchedProgram(service, {})
        signs = sum(program.received(told[at : at + size]) for at in range(0, len(told), size))
        assert (signs, program.driven, program.has_left, service.status.is_confirmed) == (5, True, True, True)
        assert service.hold == "holding"


@pytest.mark.parametrize(
    "line", [b"{", b"{}", b'{"outputs": 1}', b'{"outputs": {"valve": {"state": "fine"}}}', b"{\xff"]
)
def test_program_that_talks_nonsense_is_watched_on(line):
    service = StopService({"valve": "V"}, "watchdog", lambda _wish: None)
    program = watchdog.WatchedProgram(service, {})
    assert program.received(b"d" + line + b"\nd") == 2 and program.driven and not service.status.is_final
    assert program.received(b"{" + b"x" * (3 << 20)) == 0 and len(program.unfinished) <= (1 << 20) + 1


@pytest.mark.parametrize("answers", [True, False])
def test_takeover_confirms_what_it_read_back(answers, tmp_path, monkeypatch):
    monkeypatch.setattr(fail_safe_shutdown, "GIVE_UP_S", 0.1)
    monkeypatch.setattr("hil.safety.outputs._PATIENCE_S", 0.02)
    service = StopService({"a": "V", "b": "V"}, "watchdog", lambda _wish: None)
    made = fail_safe_shutdown.FailSafeShutdown(
        bench_of(tmp_path, {"valve": Valve(None, answers=answers)}, late_s=0.0), service
    )
    made.one_attempt()
    assert service.status.is_confirmed == answers and service.status.by == "watchdog"


def test_record_of_outputs_comes_back_as_it_was():
    known = {"a": Output(State.DRIVEN, "V", 5.0, why="x"), "b": Output(State.UNCONFIRMED, "%", can=False)}
    assert outputs_in(json.loads(json.dumps(record_of(known)))) == known


def test_control_file_is_its_owners_and_goes_with_the_run(tmp_path):
    control = Control("watchdog", ("http://127.0.0.1:1",), Tokens())
    assert control_of(control.as_strings()) == control and control_of({"no_listener": "x"}) is None
    path = tmp_path / "control.json"
    with published(control, tmp_path, lambda: False, lambda *_a, **_k: None):
        told = json.loads(path.read_text())
        assert path.stat().st_mode & 0o777 == 0o600
        assert (told["stop_url"], told["token"]) == ("http://127.0.0.1:1/stop", control.tokens.stop)
        assert control.tokens.stop not in json.dumps({**told, "token": ""})
    assert not path.exists()
    with published(control, tmp_path, lambda: True, lambda *_a, **_k: None):
        pass
    assert path.exists(), "outputs are not settled: the watchdog can still be asked"


def test_run_that_cannot_write_its_control_file_goes_on_and_says_so(tmp_path):
    noted = []
    control = Control("watchdog", ("http://127.0.0.1:1",), Tokens())
    with published(control, tmp_path / "gone", lambda: False, lambda event, **_: noted.append(event)):
        pass
    assert noted == ["no stop from a console"]


def test_watchdog_without_a_port_watches_all_the_same(monkeypatch):
    def taken(*_):
        raise OSError(98, "Address already in use")

    monkeypatch.setattr("hil.bench.stop.listener._opened", taken)
    with watchdog.listening(StopService({"valve": "V"}, "watchdog", lambda _wish: None)) as told:
        assert told == {"no_listener": "no listener for a stop: [Errno 98] Address already in use"}
