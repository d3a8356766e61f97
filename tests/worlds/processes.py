"""Processes of one world: what each holds of the system, signals, pipes between them, and how they end."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Callable
from typing import Any

from greenlet import getcurrent

from tests.worlds.tasks import Hub, Task, Waiters

_FATAL = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1, signal.SIGALRM}
_CAPACITY = 65536
_POLLING = "hil-poll"  # the one thread that drives


class Pipe:
    """Bytes from one process to another; who reads comes to its end when nobody writes any more."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self.bytes = bytearray()
        self.writers = self.readers = 1
        self.changed = Waiters(hub)

    def write(self, data: bytes, call: Callable[[], None]) -> None:
        call()
        left = memoryview(data)
        while left:
            if not self.readers:
                raise BrokenPipeError(32, "Broken pipe")
            room = _CAPACITY - len(self.bytes)
            if not room:
                self.changed.wait()
                call()
                continue
            self.bytes += left[:room]
            left = left[room:]
            self.changed.wake()

    def take(self, most: int) -> bytes:
        came = bytes(self.bytes[:most])
        del self.bytes[:most]
        self.changed.wake()
        return came

    def close_writer(self) -> None:
        self.writers = max(0, self.writers - 1)
        self.changed.wake()

    def close_reader(self) -> None:
        self.readers = 0
        self.changed.wake()


class Writer:
    """The end of a pipe on which a program speaks, as `subprocess` gives it."""

    def __init__(self, pipe: Pipe, call: Callable[[], None]) -> None:
        self._pipe, self._call, self.closed = pipe, call, False

    def write(self, data: bytes) -> int:
        if self.closed:
            raise ValueError("write to closed file")
        self._pipe.write(data, self._call)
        return len(data)

    def close(self) -> None:
        if not self.closed:
            self.closed = True
            self._pipe.close_writer()


class Reader:
    """The end of a pipe on which a program listens, as `subprocess` gives it, without a buffer."""

    def __init__(self, pipe: Pipe, call: Callable[[], None]) -> None:
        self._pipe, self._call, self.closed = pipe, call, False

    def read(self, most: int) -> bytes:
        self._call()
        while not self._pipe.bytes and self._pipe.writers:
            self._pipe.changed.wait()
            self._call()
        return self._pipe.take(most)

    def readline(self) -> bytes:
        line = b""
        while not line.endswith(b"\n") and (byte := self.read(1)):
            line += byte
        return line

    def close(self) -> None:
        self.closed = True
        self._pipe.close_reader()

    def __iter__(self) -> Any:
        return iter(self.readline, b"")

    def __enter__(self) -> Reader:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Process:
    """One process.

    Attributes:
        status: with which it ended, negative for a signal; None while it lives.
        ended_s: when; taken_s: when it had the bench.
        is_stopped: by SIGSTOP.
        values: what it has one of each kind (`System.of_process`).
        sockets: that it holds open.
        held: called when it ends, however that is: the system lets go of what it held.
        connected_s: when it connected to a device.
        has_returned: whether its main function came to its end; left: what it held then.
    """

    def __init__(self, hub: Hub, pid: int, name: str) -> None:
        self.hub, self.pid, self.name = hub, pid, name
        self.status: int | None = None
        self.ended_s = self.taken_s = float("inf")
        self.is_stopped = False
        self.tasks: list[Task] = []
        self.connected_s: list[float] = []
        self.has_returned, self.left = False, list[str]()
        self.values: dict[type, Any] = {}
        self.sockets: list[Any] = []
        self.held: list[Callable[[], None]] = []
        self.at_exit: list[Callable[[], object]] = []
        self.handlers: dict[int, Any] = {signal.SIGINT: signal.default_int_handler}
        self.blocked: set[int] = set()
        self.pending: list[int] = []
        self.ended = Waiters(hub)
        self._waiting: list[Task] = []

    @property
    def lives(self) -> bool:
        return self.status is None

    @property
    def main(self) -> Task:
        return self.tasks[0]

    def begin(self, main: Callable[[], int], born_with: set[int] = frozenset()) -> None:  # type: ignore[assignment]
        """Begin its main task; signals that it is born with are blocked."""
        self.blocked = set(born_with)
        self.tasks.append(self.hub.spawn(lambda: self._main(main), self, f"{self.name} main"))

    def _main(self, main: Callable[[], int]) -> None:
        try:
            status = main()
        except SystemExit as left:
            status = left.code if isinstance(left.code, int) else 1
        except KeyboardInterrupt:
            status = 130
        except BaseException as error:
            self.hub.fallen.append((self.main, error))
            status = 1
        for do in reversed(self.at_exit):
            do()
        self.has_returned = self.lives
        threads = [f"thread {task.name}" for task in self.tasks[1:] if not task.is_over and task.name == _POLLING]
        self.left = [*threads, *["a connection"] * len(self.sockets)]
        self.die(status)
        self.hub.greenlet.switch()

    def may_work(self, task: Task) -> bool:
        """Whether its tasks get their turn; one that is stopped has them later."""
        if self.is_stopped and self.lives:
            self._waiting.append(task)
            return False
        return self.lives

    def die(self, status: int) -> None:
        """It is gone: none of its code runs any more, and the system closes what it held."""
        if not self.lives:
            return
        self.status, self.ended_s = status, self.hub.now_s
        for let_go in [*self.held]:
            let_go()
        for held in [*self.sockets]:
            held.close_by_system()
        self.ended.wake()

    def signal(self, number: int) -> None:
        """As `kill` sends it."""
        if not self.lives:
            return
        if number == signal.SIGKILL:
            self.die(-number)
        elif number == signal.SIGSTOP:
            self.is_stopped = True
        elif number == signal.SIGCONT:
            self.is_stopped = False
            waiting, self._waiting = self._waiting, []
            for task in waiting:
                self.hub.make_ready(task)
            came = [one for one in self.pending if one not in self.blocked]
            self.pending = [one for one in self.pending if one in self.blocked]
            for one in sorted(came):
                self._deliver(one)
        elif number in self.blocked or self.is_stopped:
            if number not in self.pending:
                self.pending.append(number)
        else:
            self._deliver(number)

    def _deliver(self, number: int) -> None:
        handler = self.handlers.get(number, signal.SIG_DFL)
        if not self.lives:
            return
        if handler == signal.SIG_DFL and number in _FATAL:
            self.die(-number)
        elif callable(handler):
            self.pending.append(number)
            self.hub.make_ready(self.main)  # its wait is interrupted

    def hear(self) -> None:
        """Run the handlers of what has come, in the main task; what they raise is raised."""
        while self.pending and getcurrent() is self.main:
            deliverable = [number for number in self.pending if number not in self.blocked]
            if not deliverable:
                return
            number = min(deliverable)  # of several that have come, Python handles the least first
            self.pending.remove(number)
            handler = self.handlers.get(number, signal.SIG_DFL)
            if callable(handler):
                handler(number, None)
            elif handler == signal.SIG_DFL and number in _FATAL:
                self.die(-number)
                self.hub.greenlet.switch()

    def unblock(self, numbers: set[int]) -> None:
        self.blocked -= numbers
        self.hear()


class Child:
    """A process as the one that started it sees it: as `subprocess.Popen`."""

    def __init__(
        self, process: Process, hears: Pipe, speaks: Pipe, tells: Pipe | None, call: Callable[[], None]
    ) -> None:
        self.process, self._call, self.pid = process, call, process.pid
        self.stdin, self.stdout = Writer(hears, call), Reader(speaks, call)
        self.stderr = None if tells is None else Reader(tells, call)

    @property
    def returncode(self) -> int | None:
        return self.process.status

    def poll(self) -> int | None:
        self._call()
        return self.process.status

    def wait(self, timeout: float | None = None) -> int:
        self._call()
        hub = self.process.hub
        until_s = None if timeout is None else hub.now_s + timeout
        while self.process.status is None:
            if until_s is not None and hub.now_s >= until_s:
                raise subprocess.TimeoutExpired("child", timeout or 0.0)
            self.process.ended.wait(until_s)
            self._call()
        return self.process.status

    def send_signal(self, number: int) -> None:
        self._call()
        self.process.signal(number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


class ParentEnd:
    """The program that started this process (see `hil.system.parent.Parent`)."""

    def __init__(self, program: Process, hears: Pipe, speaks: Pipe, call: Callable[[], None]) -> None:
        self._program, self._hears, self._speaks, self._call = program, hears, speaks, call
        self._requests: list[Any] = []

    def request(self, what: Any) -> None:
        self._call()
        self._requests.append(what)
        self._hears.changed.wake()

    def next(self, timeout_s: float | None) -> Any:
        self._call()
        hub = self._program.hub
        until_s = None if timeout_s is None else hub.now_s + timeout_s
        while True:
            if self._hears.bytes or not self._hears.writers:
                return self._hears.take(4096)
            if self._requests:
                return self._requests.pop(0)
            if not self._program.lives:
                return b""
            if until_s is not None and hub.now_s >= until_s:
                return None
            self._wait(until_s)
            self._call()

    def _wait(self, until_s: float | None) -> None:
        self._program.ended.add(getcurrent())  # either of both ends the wait
        self._hears.changed.wait(until_s)

    def say(self, what: bytes) -> None:
        try:
            self._speaks.write(what, self._call)
        except OSError:
            return

    def kill(self, _pid: int) -> None:
        self._call()
        self._program.signal(signal.SIGKILL)

    def close(self) -> None:
        self._call()
