"""The heartbeat: how a program that drives a bench tells its watchdog that it lives (see `hil.bench.watchdog`)."""

from __future__ import annotations

import json
import os
import stat
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, NamedTuple

from hil.bench.read import BenchFile
from hil.bench.stop.control import Control, control_of
from hil.bench.stop.listener import Listener
from hil.bench.stop.stop_service import StopService
from hil.child import PIPE, TimeoutExpired
from hil.errors import HardwareError, StoppedError
from hil.printable import printable
from hil.safety.operator import Asked, Operator
from hil.safety.outputs import Outputs
from hil.system import system
from hil.system.signals import HOLDING_UP, WAKE, name_of
from hil.system.tcp import close_in_children

READY, DRIVEN, AT_REST, FAREWELL, ANSWER, ERROR = b"ready ", b"d", b"s", b"q", b".", b"error "
CONFIRMING = b"c"  # a sign of life: outputs are commanded safe and read back, and nothing else comes in between
HANDS_OVER, TAKEN = b"h", b"+"  # the program ends and its outputs are not settled; the watchdog goes on
REQUESTS: Mapping[Asked, bytes] = {"stop": b"!", "hold": b"=", "resume": b">"}
BY = b"@"  # from the watchdog: who asks for the stop that follows, a JSON string on a line
LINE = b"{"  # to the watchdog: a line of JSON begins, {"outputs": …} after a stop, or {"holding": …}
REPORT_FILE = "watchdog.json"
GIVE_UP_S = 60.0  # so long a watchdog tries to reach a device
_START_S = 60.0
_FAREWELL_S = 10.0
_DEATH_S = 1.0
_LAST_BREATH_S = 0.05  # its pipe is closed a moment before its status can be had
_TAKES_OVER_S = 2.0  # a watchdog that does not say so within this time is taken for dead
_LONGEST_REASON = 4096


class WatchdogHandle(NamedTuple):
    """Gives a sign of life, told whether outputs are driven (else they are safe); and where the run is stopped.

    `hand_over` leaves the outputs to the watchdog; what is to be said of that. `say_identities` tells it which devices
    were opened.
    """

    beat: Callable[[bool], None]
    control: Control | None
    note: str = ""
    hand_over: Callable[[], str] = lambda: ""
    say_identities: Callable[[], None] = lambda: None


@contextmanager
def watched(
    file: BenchFile, run: Path, output_states: Outputs, operator: Operator | None = None
) -> Iterator[WatchdogHandle]:
    """A watchdog process while inside; yields the function that gives a sign of life.

    That function raises `StoppedError` when the watchdog itself is gone or hangs. A simulated bench, and one whose file
    says `watchdog_s = 0`, has no watchdog; an operator who is to be heard there is heard in this process.

    At the end the watchdog goes home when no command can do more for any output, and else goes on trying, whatever the
    error was; then the error says so.

    Raises:
        HardwareError: the watchdog cannot reach the devices.
    """
    if file.is_simulated or not file.bench.protection.watchdog_s:
        with _heard_here(file, output_states, operator) as watch:
            yield watch
        return
    operator = operator or Operator()
    client = HeartbeatClient(file, run, operator)
    operator.tell, operator.holding, operator.confirming = client.say_outputs, client.say_holding, client.say_confirming
    try:
        client.wait_until_ready()
        yield WatchdogHandle(client.beat, client.control, client.no_listener, client.hand_over, client.say_identities)
    except BaseException as error:
        if not output_states.are_commanded:
            error.add_note(client.hand_over())
        raise
    finally:
        if output_states.are_commanded:
            client.say_outputs(output_states)
            client.say_farewell()
        else:
            client.stop()


@contextmanager
def _heard_here(file: BenchFile, output_states: Outputs, operator: Operator | None) -> Iterator[WatchdogHandle]:
    """Without a watchdog: this process listens itself, for as long as the bench is open."""
    if operator is None:
        yield WatchdogHandle(lambda _driven: None, None)
        return
    service = StopService(units_of(file), "run", lambda request: operator.ask(request, service.stopped_by))
    operator.tell = lambda outputs: service.tell(outputs.by_name, "run")
    operator.holding = service.holds
    try:
        listener = system.serve(lambda: Listener(service, "run"), service)
    except OSError as error:
        yield WatchdogHandle(lambda _driven: None, None, f"no listener for a stop: {error}")
        return
    try:
        yield WatchdogHandle(lambda _driven: None, listener.control)
    finally:
        if output_states.by_name:
            operator.answer(output_states)
        listener.close()


def units_of(file: BenchFile) -> dict[str, str]:
    """The unit of each output of a bench."""
    return {name: channel.unit for name, channel in file.bench.channels.items() if channel.is_output}


class HeartbeatClient:
    """The watchdog process of a run, as seen from the run.

    Args:
        file: the bench that it watches over.
        run: the run folder, for its report.
        operator: who hears what is asked at the watchdog's listener.

    Attributes:
        control: where that listener is.
        no_listener: why there is none.
    """

    def __init__(self, file: BenchFile, run: Path, operator: Operator | None = None) -> None:
        self._operator, self._devices = operator or Operator(), file.devices
        self.control: Control | None = None
        self.no_listener = ""
        self._limit_s = file.bench.protection.watchdog_s
        self._report = run / REPORT_FILE
        words = [str(file.path.resolve()), str(system.pid()), str(run.absolute()), str(Path.cwd())]
        self._speaks = _is_terminal_or_file(sys.stderr)
        # A session of its own: a Ctrl-C or a closed terminal reaches the run alone. Who reads a pipe of the run does
        # not wait for it.
        with system.blocking(HOLDING_UP):  # it is born with that, so that none ends it before it can ignore them
            self._process = system.child(
                "hil.bench.watchdog", words, _state_from_anywhere(), stdin=PIPE, stdout=PIPE,
                stderr=None if self._speaks else PIPE, bufsize=0, start_new_session=True,
                cwd=Path(os.sep).resolve(),
            )  # fmt: skip
        close_in_children(self._process.stdin)  # held there, it would not end with this program
        self._started, self._taken = system.event(), system.event()
        self._failed = self._by = ""
        self._heard_s = self._asked_s = system.now_s()
        system.thread(self._listen, name="hil-watchdog").start()
        if self._process.stderr is not None:
            system.thread(self._relay, self._process.stderr).start()

    def wait_until_ready(self) -> None:
        """Return when the watchdog has made the outputs safe once, by its own way.

        Raises:
            HardwareError: it could not.
        """
        if not self._started.wait(_START_S) or self._failed:
            self._end()
            raise HardwareError(f"the watchdog process: {self._failed or f'not ready within {_START_S:g} s'}")

    def beat(self, driven: bool) -> None:
        """Give a sign of life.

        Raises:
            StoppedError: the watchdog does not answer any more.
        """
        self._sign(DRIVEN if driven else AT_REST)

    def say_confirming(self) -> None:
        """Give the sign of life of a program that makes its outputs safe and reads them back. Never raises."""
        with suppress(StoppedError):
            self._sign(CONFIRMING)

    def _sign(self, sign: bytes) -> None:
        now_s = system.now_s()
        if self._failed or (self._asked_s > self._heard_s and now_s - self._asked_s > self._limit_s):
            raise self._watchdog_gone()
        if self._asked_s <= self._heard_s:
            self._asked_s = now_s  # the oldest sign of life that is not answered yet
        try:
            self._say(sign)
        except (OSError, ValueError):
            raise self._watchdog_gone(self._death(_LAST_BREATH_S)) from None

    def say_farewell(self) -> None:
        """Let the watchdog end: nothing is left to do."""
        try:
            self._say(FAREWELL)
            self.stop()
            self._wake()
            self._process.wait(_FAREWELL_S)
        except (OSError, ValueError, TimeoutExpired):
            self._end()

    def say_outputs(self, output_states: Outputs) -> None:
        """Tell what is known of the outputs. Never raises."""
        if output_states.by_name:
            self._say_line({"outputs": output_states.record()})

    def say_identities(self) -> None:
        """Tell what the devices said that they are: the watchdog may have heard nothing when it opened them."""
        self._say_line({"identities": {name: device.pin.identity for name, device in self._devices.items()}})

    def say_holding(self, holds: bool) -> None:
        """Tell whether the run stands, as the operator asked."""
        self._say_line({"holding": holds})

    def hand_over(self) -> str:
        """Leave the rest to the watchdog; what is to be said of it. That it goes on is said when it has said so.

        May be called again.
        """
        with suppress(OSError, ValueError):
            self._say(HANDS_OVER)
        self._wake()
        taken = self._taken.wait(_TAKES_OVER_S)
        self.stop()
        if not taken:
            return f"the watchdog process {self._failed or 'does not answer'}: nobody goes on trying"
        where = f"here and in {self._report}" if self._speaks else f"in {self._report}"
        return f"the watchdog process goes on trying for {GIVE_UP_S:g} s and tells what came of it {where}"

    def stop(self) -> None:
        """Leave the watchdog alone: it takes the program for dead and does its work."""
        with suppress(OSError):
            if self._process.stdin is not None:
                self._process.stdin.close()

    def _wake(self) -> None:
        """One that somebody has paused is needed now."""
        if WAKE is not None and self._process.poll() is None:
            self._process.send_signal(WAKE)

    def _end(self) -> None:
        self.stop()
        self._process.kill()
        self._process.wait()

    def _watchdog_gone(self, ended: str = "") -> StoppedError:
        ended = ended or ("" if self._process.poll() is None else self._death())  # its pipe may tell that later
        how = self._failed or ended or f"gave no answer for {self._limit_s:g} s"
        return StoppedError(f"the watchdog process {how}; the run was stopped")

    def _say_line(self, content: Mapping[str, Any]) -> None:
        with suppress(OSError, ValueError):
            self._say(json.dumps(content).encode() + b"\n")

    def _say(self, what: bytes) -> None:
        pipe = self._process.stdin
        if pipe is None or pipe.closed:
            raise BrokenPipeError
        pipe.write(what)

    def _listen(self) -> None:
        with self._process.stdout as output:  # type: ignore[union-attr] # it is a pipe
            first = output.readline()
            self._failed = "" if first.startswith(READY) else _reason(first) or self._death()
            if not self._failed:
                started = json.loads(first.removeprefix(READY))
                self.control, self.no_listener = control_of(started), started.get("no_listener", "")
            self._heard_s = self._asked_s = system.now_s()
            self._started.set()
            last = b""
            while more := output.read(4096):
                self._heard_s = system.now_s()
                last = self._heed((last + more)[-_LONGEST_REASON:])
        self._failed = self._failed or _reason(last) or self._death()

    def _heed(self, signs: bytes) -> bytes:
        """Do what is asked, and return what is left: the beginning of a reason."""
        while signs:
            sign, rest = signs[:1], signs[1:]
            if sign == BY:
                line, ended, rest = rest.partition(b"\n")
                if not ended:  # the rest of it is on its way
                    break
                self._by = str(json.loads(line))
            elif sign == TAKEN:
                self._taken.set()
            elif sign != ANSWER:
                request = next((request for request, word in REQUESTS.items() if word == sign), None)
                if request is None:
                    break
                self._operator.ask(request, self._by)
            signs = rest
        return signs

    def _relay(self, output: IO[bytes]) -> None:
        """What it says on stderr, said here."""
        with output:
            for line in iter(output.readline, b""):
                with suppress(OSError, ValueError):
                    print(printable(line.decode(errors="replace").rstrip()), file=sys.stderr, flush=True)

    def _death(self, within_s: float = _DEATH_S) -> str:
        """How it ended without a word."""
        try:
            status = self._process.wait(within_s)
        except TimeoutExpired:
            return "ended"
        return f"ended: killed by {name_of(-status)}" if status < 0 else f"ended with status {status}"


def _reason(data: bytes) -> str:
    """Why it died, where it could say so."""
    _, found, text = data.partition(ERROR)
    return text.decode(errors="replace").strip() if found else ""


def _is_terminal_or_file(stream: IO[str] | None) -> bool:
    """Whether a process may hold this stream for a minute without anybody waiting for its end."""
    try:
        mode = os.fstat(stream.fileno()).st_mode  # type: ignore[union-attr]
        return stat.S_ISREG(mode) or stat.S_ISCHR(mode)
    except (AttributeError, OSError, ValueError):  # closed, or no stream of the system
        return False


def _state_from_anywhere() -> dict[str, str]:
    """The folder of what is kept between runs as it is meant from here: the watchdog begins in another one."""
    folder = os.environ.get("HIL_STATE_DIR")
    return {"HIL_STATE_DIR": str(Path(folder).absolute())} if folder else {}
