"""What stands in for `hil.system.system` in a world: whoever asks is the process whose task is at work."""

from __future__ import annotations

import errno
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace
from typing import Any

from filelock import Timeout
from greenlet import getcurrent

from hil.bench.stop.control import Control, Tokens
from tests.worlds import tasks
from tests.worlds.can_bus import BusEnd, CanBus
from tests.worlds.disk import Disk
from tests.worlds.network import Host, Socket
from tests.worlds.processes import Child, ParentEnd, Pipe, Process
from tests.worlds.serial_line import SerialLine, SerialPort

BEGAN = datetime(2026, 3, 2, 12, tzinfo=UTC)
STEP_S = 3600.0  # of the clock on the wall; no world goes on for half as long


def instant_s(utc: str) -> float:
    """When that was, whether the clock on the wall had stepped or not."""
    return ((datetime.fromisoformat(utc) - BEGAN).total_seconds() + STEP_S / 2.0) % STEP_S - STEP_S / 2.0


class WorldSystem:
    """See `hil.system.system.System`; one for all processes of a world.

    Args:
        hub: the scheduler.
        hosts: what is reached, by address and port.
        programs: what a module does as a process of its own, by its name.
        starts_s: least and greatest time until a new process has begun.

    Attributes:
        stepped_s: the clock on the wall is so much ahead.
        lines, buses: serial lines by the path of their port, CAN buses by channel.
    """

    def __init__(
        self, hub: tasks.Hub, hosts: dict[tuple[str, int], Host],
        programs: Mapping[str, Callable[..., int]], starts_s: tuple[float, float],
    ) -> None:  # fmt: skip
        self.call = hub.point
        self.hub, self._hosts, self._programs, self._starts_s = hub, hosts, programs, starts_s
        self.disk = Disk(hub.draw, self.sleep, lambda: hub.now_s)
        self.stepped_s = 0.0
        self.processes: list[Process] = []
        self.living = 0
        self.asleep_s = 0.0
        self.services: dict[str, Any] = {}
        self.lines: dict[str, SerialLine] = {}
        self.buses: dict[str, CanBus] = {}
        self.locks: dict[str, Process] = {}
        self.born: list[Callable[[Process], None]] = []

    def new_process(self, name: str) -> Process:
        process = Process(self.hub, 1000 + len(self.processes), name)
        self.processes.append(process)
        self.living += 1
        process.held.append(self._one_less)
        return process

    def _one_less(self) -> None:
        self.living -= 1

    @property
    def process(self) -> Process:
        """Whose task is at work."""
        return getcurrent().owner  # type: ignore[union-attr]

    def now_s(self) -> float:
        self.call()
        return self.hub.now_s - self.asleep_s

    def awake_or_asleep_s(self) -> float:
        return self.hub.now_s

    def utc(self) -> datetime:
        return BEGAN + timedelta(seconds=self.hub.now_s + self.stepped_s)

    def sleep(self, time_s: float) -> None:
        self.call()
        until_s = self.hub.now_s + time_s
        while self.hub.now_s < until_s:
            self.hub.pause(until_s)
            self.call()

    def thread(self, run: Callable[..., object], *arguments: Any, name: str = "hil") -> tasks.Thread:
        return tasks.Thread(self.hub, self.call, lambda: run(*arguments), self.process, name)

    def later(self, after_s: float, do: Callable[[], object]) -> tasks.Thread:
        return tasks.Thread(self.hub, self.call, do, self.process, "later", after_s)

    def is_this_thread(self, thread: tasks.Thread) -> bool:
        return thread.task is getcurrent()

    def is_main_thread(self) -> bool:
        return self.process.main is getcurrent()

    def thread_id(self) -> int:
        return id(getcurrent())

    def lock(self) -> tasks.Lock:
        return tasks.Lock(self.hub, self.call)

    def rlock(self) -> tasks.Lock:
        return tasks.Lock(self.hub, self.call, again=True)

    def event(self) -> tasks.Event:
        return tasks.Event(self.hub, self.call)

    def queue(self) -> tasks.Queue:
        return tasks.Queue(self.hub, self.call)

    def pid(self) -> int:
        return self.process.pid

    def of_process(self, kind: type) -> Any:
        values = self.process.values
        if kind not in values:
            values[kind] = kind()
        return values[kind]

    def at_exit(self, do: Callable[[], object]) -> None:
        self.process.at_exit.append(do)

    def not_at_exit(self, do: Callable[[], object]) -> None:
        self.process.at_exit = [one for one in self.process.at_exit if one != do]

    def leave(self, status: int) -> None:
        self.call()
        self.process.die(status)
        self.hub.greenlet.switch()

    def child(self, module: str, arguments: Sequence[str], _told: Mapping[str, str], **how: Any) -> Child:
        self.call()
        program, parent = self._programs[module], self.process
        process = self.new_process(module)
        hears, speaks = Pipe(self.hub), Pipe(self.hub)
        tells = Pipe(self.hub) if how.get("stderr") is not None else None
        process.values["hears"], process.values["speaks"], process.values["tells"] = hears, speaks, tells  # type: ignore[index]
        process.held += [hears.close_reader, speaks.close_writer, *([tells.close_writer] if tells else [])]
        child = Child(process, hears, speaks, tells, self.call)
        parent.held += [child.stdin.close, speaks.close_reader, *([tells.close_reader] if tells else [])]
        starts_s = self.hub.draw.uniform(*self._starts_s)

        def main() -> int:
            self.sleep(starts_s)
            return program(*arguments)

        process.begin(main, set(parent.blocked))
        for tell in self.born:
            tell(process)
        return child

    def parent(self, pid: int) -> ParentEnd:
        mine = self.process.values
        program = next(one for one in self.processes if one.pid == pid)
        return ParentEnd(program, mine["hears"], mine["speaks"], self.call)  # type: ignore[index]

    def handler_of(self, number: int) -> Any:
        return self.process.handlers.get(number, signal.SIG_DFL)

    def handle(self, number: int, handler: Any) -> None:
        self.call()
        self.process.handlers[number] = handler

    def raise_signal(self, number: int) -> None:
        self.process.signal(number)
        self.call()

    def interrupt_main_thread(self, number: int) -> bool:
        self.call()
        self.process.signal(number)
        return True

    @contextmanager
    def blocking(self, numbers: Sequence[int]) -> Iterator[None]:
        process = self.process
        before = set(process.blocked)
        process.blocked |= set(numbers)
        try:
            yield
        finally:
            process.blocked = before
            self.call()

    def unblock(self, numbers: Sequence[int]) -> None:
        self.process.unblock(set(numbers))

    def addresses(self, host: str, port: int) -> list[Any]:
        return [(2, 1, 6, (host, port))]

    def new_socket(self, _family: int, _kind: int, _protocol: int) -> Socket:
        return Socket(self.hub, self._hosts, self.process, self.call)

    def is_readable(self, held: Socket, wait_s: float) -> bool:
        return held.is_readable(wait_s)

    def unacknowledged(self, held: Socket) -> int:
        self.call()
        return held.unacknowledged()

    def forget(self, held: Socket) -> None:
        held.forget()

    def serial(self, url: str, **speech: Any) -> SerialPort:
        self.call()
        line = self.lines[url]
        if line.is_pulled:
            raise OSError(errno.ENOENT, f"could not open port {url}: No such file or directory")
        if line.ports and speech["exclusive"]:
            raise OSError(errno.EAGAIN, f"could not open port {url}: Resource temporarily unavailable")
        return SerialPort(self.hub, line, self.process, self.call, speech)

    def can_bus(self, *, channel: str, **_which: Any) -> BusEnd:
        self.call()
        return BusEnd(self.hub, self.buses[channel], self.process, self.call)

    def visa(self, name: str, _timeout_s: float) -> Any:
        """None: pyvisa-py keeps sockets of its own."""
        raise OSError(errno.ENODEV, f"{name}: no instrument of VISA is in this world")

    def serve(self, _listener: Callable[[], Any], service: Any) -> Any:
        """No event loop: whoever presses asks the service itself, in a thread of its process."""
        self.call()
        self.services[service.status.by] = (self.process, service)
        return SimpleNamespace(control=Control(service.status.by, ("http://world",), Tokens()), close=service.close)

    def write(self, file: Any, data: Any) -> int:
        return self.disk.write(file, data)

    def sync(self, descriptor: int) -> None:
        self.disk.sync(descriptor)

    def lock_file(self, path: str) -> Any:
        return _FileLock(self, path)


class _FileLock:
    """A file that one process at a time holds; it ends with the process."""

    def __init__(self, system: WorldSystem, path: str) -> None:
        self._system, self._path = system, path

    def acquire(self) -> None:
        self._system.call()
        holder, process = self._system.locks.get(self._path), self._system.process
        if holder is not None and holder.lives:
            raise Timeout(self._path)
        self._system.locks[self._path] = process
        process.taken_s = min(process.taken_s, self._system.hub.now_s)

    def release(self) -> None:
        self._system.call()
        self._system.locks.pop(self._path, None)
