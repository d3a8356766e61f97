"""The watchdog: a process of its own that makes outputs safe when the program that drives a bench dies or hangs.

    python -P -m hil.bench.watchdog BENCH.toml PID RUN FOLDER

It hears the program through a pipe, a byte for each sign of life, and answers each. Before anything moves it opens
its own way to the devices once and makes their outputs safe, so that this way is known to work. From then on it does
not touch them, until the program hands over or dies without a farewell, or is silent for too long while outputs are
driven (it hangs: then the watchdog kills it first, so that it cannot wake up and go on). What lies in the pipe is
heard before anything is judged, also after a pause of its own. Until its work is done it ignores every signal that
can be ignored: a shutdown sends SIGTERM to all, and it is what makes the outputs safe then. Each device is made safe
and read back by itself, whatever the others do, and those that fail are told of and tried again; one that has the
name of a device but is another one than before is not touched. It also listens for a stop (see `hil.bench.stop`): it
tells the program, and takes over in the same way when that does not begin to make its outputs safe within
`CONFIRMS_S`. One that says that it reads them back, as it must for a while after a lost answer, is left alone while
it gives signs of life, and hands over what it could not confirm. What the watchdog did stands in `watchdog.json` in
the run folder, or in the user's state folder when that is gone. Paths in the bench file are meant from FOLDER;
nothing in it is imported.
"""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from hil.bench.device import DeviceInUse
from hil.bench.fail_safe_shutdown import FailSafeShutdown, tried_once
from hil.bench.heartbeat import (
    ANSWER,
    AT_REST,
    BY,
    CONFIRMING,
    ERROR,
    FAREWELL,
    GIVE_UP_S,
    HANDS_OVER,
    LINE,
    READY,
    REPORT_FILE,
    REQUESTS,
    TAKEN,
    units_of,
)
from hil.bench.lease import leased
from hil.bench.read import BenchFile, read_bench
from hil.bench.stop.control import withdraw
from hil.bench.stop.listener import Listener
from hil.bench.stop.stop_service import StopService
from hil.errors import HardwareError, HilError, InUseError, reason
from hil.record.durable import write_whole
from hil.record.state import state_path
from hil.safety.operator import Asked
from hil.safety.outputs import outputs_in, record_of
from hil.stderr import write
from hil.system import system
from hil.system.parent import Parent
from hil.system.signals import HOLDING_UP, IGNORED

CONFIRMS_S = 0.2  # after a stop the program has so long to be confirming, or done
_SO_FAR = "watchdog-so-far"  # what is told before the last word, for who cannot hear it on stderr
_LONGEST_LINE = 1 << 20
_TELLS_S = 5.0  # so long a stopped terminal is waited for
_LEASE_AGAIN_S = 0.2  # how often a bench that another program has is asked for
_RELEASE_S = 2.0  # the system needs a moment to end a killed process, its lease and its hold on serial ports


def main(path: str, pid: str, run: str, folder: str) -> int:
    """Watch a program; returns the exit status. Whatever it dies of, it says so to the program and on stderr."""
    for number in HOLDING_UP:
        system.handle(number, IGNORED)
    system.unblock(HOLDING_UP)  # blocked since before it began, see `HeartbeatClient`
    program: Parent[Asked]
    with closing(system.parent(int(pid))) as program:
        try:
            os.chdir(folder)
            return _watch(Path(path), int(pid), Path(run), program)
        except BaseException as error:
            text = " ".join(f"died of {type(error).__name__}: {error}".split())
            program.say(ERROR + f"{text}\n".encode())
            _tell(text)
            return HardwareError.exit_status


def _watch(path: Path, pid: int, run: Path, parent: Parent[Asked]) -> int:
    try:
        file = read_bench(path)
        left = tried_once(file)
        if left:
            raise HardwareError("; ".join(left))
    except HilError as error:
        parent.say(ERROR + f"{reason(error)}\n".encode())
        return error.exit_status
    service = StopService(units_of(file), "watchdog", parent.request)
    with listening(service) as control:
        parent.say(READY + json.dumps(control).encode() + b"\n")
        why = watch_over(parent, file.bench.protection.watchdog_s, pid, service, file.devices)
        if why:
            take_over(Reporter(file, run, pid, why), service)
            withdraw(run)
    return 0


@contextmanager
def listening(service: StopService) -> Iterator[dict[str, str]]:
    """A listener for stops while inside; yields where it is, or why there is none, which keeps no run from starting."""
    try:
        listener = system.serve(lambda: Listener(service, "watchdog"), service)
    except Exception as error:
        yield {"no_listener": f"no listener for a stop: {reason(error)}"}
        return
    try:
        yield listener.control.as_strings()
    finally:
        listener.close()


class WatchedProgram:
    """What is known of the program from what it said, byte by byte.

    Attributes:
        driven: whether outputs are driven, or not known to be safe yet.
        confirms: it makes its outputs safe and reads them back, and is not through.
        has_left: it said farewell.
        hands_over: it ends, and its outputs are not settled.
        unfinished: what has come of a line that has not ended.
    """

    def __init__(self, service: StopService, devices: Mapping[str, DeviceInUse]) -> None:
        self._service, self._devices = service, devices
        self.unfinished = b""
        self.driven = self.confirms = self.has_left = self.hands_over = False

    def received(self, what: bytes) -> int:
        """Take it in; returns how many signs of life it held."""
        signs, self.unfinished = 0, self.unfinished + what
        while self.unfinished:
            before, begun, after = self.unfinished.partition(LINE)
            line, ended, left = after.partition(b"\n")
            signs += self._signs(before)
            if begun and not ended:  # the rest of the line is on its way
                self.unfinished = begun + after[:_LONGEST_LINE]
                break
            if begun:
                self._line(begun + line)
            self.unfinished = left
        return signs

    def _signs(self, signs: bytes) -> int:
        self.has_left = self.has_left or FAREWELL in signs
        self.hands_over = self.hands_over or HANDS_OVER in signs
        if signs:
            self.driven, self.confirms = signs[-1:] != AT_REST, signs[-1:] == CONFIRMING
        return len(signs)

    def _line(self, line: bytes) -> None:
        with suppress(ValueError, KeyError, TypeError, AttributeError):  # garbled: nothing is taken for confirmed
            message = json.loads(line)
            if "holding" in message:
                self._service.holds(bool(message["holding"]))
            if "outputs" in message:
                self._service.tell(outputs_in(message["outputs"]), "run")
            for name, identity in message.get("identities", {}).items():
                pin = self._devices[name].pin  # what the run drives is what has to be made safe
                pin.identity = identity or pin.identity


def watch_over(
    parent: Parent[Asked], limit_s: float, pid: int, service: StopService, devices: Mapping[str, DeviceInUse]
) -> str:
    """Listen until there is something to do, and say why; empty when the program said farewell."""
    program = WatchedProgram(service, devices)
    silent_at_s = confirms_by_s = math.inf
    while True:
        until_s = silent_at_s if program.confirms else min(silent_at_s, confirms_by_s)
        heard = parent.next(None if until_s == math.inf else max(0.0, until_s - system.now_s()))
        if heard is None:
            if system.now_s() - silent_at_s > 0.5 * limit_s:  # this process did not run, nor perhaps the program
                silent_at_s = system.now_s() + limit_s
                continue
            parent.kill(pid)
            if until_s < silent_at_s:
                return f"was told to stop, did not confirm within {CONFIRMS_S:g} s, and was killed"
            return f"gave no sign of life for {limit_s:g} s while outputs were driven, and was killed"
        if isinstance(heard, str):
            by = BY + json.dumps(service.stopped_by).encode() + b"\n" if heard == "stop" and service.stopped_by else b""
            parent.say(by + REQUESTS[heard])
            if heard == "stop":
                confirms_by_s = min(confirms_by_s, system.now_s() + CONFIRMS_S)
            continue
        if not heard:
            return "ended without making its outputs safe"
        parent.say(ANSWER * program.received(heard))
        if program.has_left:
            return ""
        if program.hands_over:
            parent.say(TAKEN)
            return "ended without making its outputs safe"
        silent_at_s = system.now_s() + limit_s if program.driven else math.inf
        if service.status.is_final:
            confirms_by_s = math.inf


@dataclass(frozen=True, slots=True)
class Reporter:
    """What is told of the outputs of a program, on stderr and on disk."""

    file: BenchFile
    run: Path
    pid: int
    why: str

    def so_far(self, text: str, **report: object) -> None:
        """Before the last word, for who cannot hear it on stderr."""
        self._write(_SO_FAR, report)
        self._say(text)

    def at_last(self, text: str, **report: object) -> None:
        """What came of it."""
        self._write(Path(REPORT_FILE).stem, report)
        for path in self._places(_SO_FAR):
            with suppress(OSError):
                path.unlink()
        self._say(text)

    def _say(self, text: str) -> None:
        _tell(f"process {self.pid} {self.why}; {text}")

    def _write(self, kind: str, report: Mapping[str, object]) -> None:
        content = json.dumps({"why": self.why, **report}, indent=1, ensure_ascii=False) + "\n"
        places = self._places(kind)
        for path in places:
            try:
                if path is places[-1]:
                    path.parent.mkdir(parents=True, exist_ok=True)
                write_whole(path, content)
                break
            except OSError:  # no folder, or no room in it
                continue

    def _places(self, kind: str) -> tuple[Path, Path]:
        """In the folder of the run, and where it goes when that is gone."""
        return self.run / f"{kind}.json", state_path(kind, self.file.bench.name, ".json")


def take_over(reporter: Reporter, service: StopService) -> None:
    """Make the outputs of a program that is gone safe, and tell what came of it."""
    service.forget()
    shutdown = _shut_down(reporter, service)
    if shutdown is None:
        return
    took_s = round(shutdown.took_s, 3)
    outputs: dict[str, Any] = {"outputs": record_of(shutdown.outputs)}
    if service.stopped_by:
        outputs["stopped_by"] = service.stopped_by
    if shutdown.left:
        reporter.at_last(f"NOT SAFE: {_with_remedy(shutdown.left)}", not_safe=shutdown.left, tried_s=took_s, **outputs)
    elif shutdown.unasked:
        text = f"outputs commanded safe in {took_s:g} s; {'; '.join(shutdown.unasked)}"
        reporter.at_last(text, commanded_after_s=took_s, unconfirmed=shutdown.unasked, **outputs)
    else:
        reporter.at_last(f"outputs made safe in {took_s:g} s", safe_after_s=took_s, **outputs)


def _shut_down(reporter: Reporter, service: StopService) -> FailSafeShutdown | None:
    """Made safe as far as could be; None where another program has the bench, and keeps it for `GIVE_UP_S`.

    Whoever takes a bench makes its outputs safe when it opens them. One that fails in that lets go of it, and what the
    dead program had driven would stand.
    """
    until_s, is_announced = system.now_s() + GIVE_UP_S, False
    while True:
        shutdown = FailSafeShutdown(reporter.file, service)
        try:
            with _lease_of_the_dead(reporter.file, reporter.pid, shutdown.one_attempt):
                shutdown.with_patience(partial(_report_not_yet, reporter, shutdown))
            return shutdown
        except InUseError as taken:
            report = {"left_alone": str(taken), "outputs": record_of(shutdown.outputs)}
            text = str(taken)
        if system.now_s() >= until_s:
            reporter.at_last(text, **report)
            return None
        if not is_announced:
            is_announced = True
            reporter.so_far(text, **report)
        system.sleep(_LEASE_AGAIN_S)


def _report_not_yet(reporter: Reporter, shutdown: FailSafeShutdown) -> None:
    left, outputs = shutdown.left, record_of(shutdown.outputs)
    so_far = f"NOT SAFE so far: {_with_remedy(left)}; goes on trying for {GIVE_UP_S:g} s"
    reporter.so_far(shutdown.announcement or so_far, not_safe=left, goes_on_for_s=GIVE_UP_S, outputs=outputs)


def _with_remedy(left: list[str]) -> str:
    text = "; ".join(left)
    return text if "emergency stop" in text else f"{text}; use the emergency stop"


@contextmanager
def _lease_of_the_dead(file: BenchFile, pid: int, meanwhile: Callable[[], None]) -> Iterator[None]:
    """The lease on the bench, as soon as the system has taken it from the dead program.

    Until then the bench is nobody else's, and `meanwhile` is done. A program that does not die keeps it, and so does a
    child that it has forked; then it goes on without: outputs matter more than order.
    """
    busy = False
    deadline_s = system.now_s() + _RELEASE_S
    with ExitStack() as held:
        while system.now_s() < deadline_s:
            try:
                held.enter_context(leased(file))
                break
            except InUseError as taken:
                if taken.pid not in (pid, None):
                    raise
                if not busy:
                    busy = True
                    meanwhile()
            except Exception:  # no place for leases
                break
            system.sleep(0.01)
        yield


def _tell(text: str) -> None:
    write(f"hil watchdog: {text}\n", _TELLS_S)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
