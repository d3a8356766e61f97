"""Tasks of one world: threads of several processes in one, in virtual time, in an order that one seed draws.

Each task is a greenlet. Exactly one is at work, until it waits or a drawn moment of the seam takes it away (`point`).
Time moves on by a little with each call, and to the next thing that is due when nobody can work.
"""

from __future__ import annotations

import heapq
import random
from collections import deque
from collections.abc import Callable
from queue import Empty
from typing import Any

from greenlet import getcurrent, greenlet

_never_resumed: list[Task] = []  # one that is let go of would run what a killed process never runs


class Task(greenlet):
    """A thread of a process.

    Attributes:
        owner: the process; None for what belongs to the world itself.
        woken: whether it was woken, where it waits; its wait may also end by the time.
        waits: counts its waits, so that an alarm of an earlier one wakes nobody.
    """

    def __init__(self, hub: Hub, run: Callable[[], object], owner: Any = None, name: str = "") -> None:
        super().__init__(self._main, hub.greenlet)
        self.hub, self.owner, self.name, self._do = hub, owner, name, run
        self.woken, self.waits, self.is_over, self.is_ready = False, 0, False, False
        self.watchers: list[Task] = []

    def _main(self) -> None:
        try:
            self._do()
        except SystemExit:
            pass  # ends a thread without a word
        except BaseException as error:
            self.hub.fallen.append((self, error))
        finally:
            self.is_over = True
            for watcher in self.watchers:
                self.hub.wake(watcher)


class Hub:
    """The scheduler.

    Args:
        seed: of every draw.
        hurry: chance that a call of the seam takes the task away.
        step_s: how long a call of the seam takes.
    """

    def __init__(self, seed: int, hurry: float = 0.05, step_s: float = 5e-6) -> None:
        self.draw = random.Random(seed)
        self._random = self.draw.random
        self.now_s = 0.0
        self.greenlet = getcurrent()
        self.fallen: list[tuple[Task, BaseException]] = []
        self.tasks: list[Task] = []
        self.calls = 0
        self._hurry, self._step_s = hurry, step_s
        self._ready: list[Task] = []
        self._alarms: list[tuple[float, int, Callable[[], None]]] = []
        self._count = 0

    def spawn(self, run: Callable[[], object], owner: Any = None, name: str = "") -> Task:
        """A task that is ready to begin."""
        task = Task(self, run, owner, name)
        self.tasks.append(task)
        self.make_ready(task)
        return task

    def make_ready(self, task: Task) -> None:
        """Let a task work when its turn comes."""
        if not task.is_ready and not task.is_over:
            task.is_ready = True
            self._ready.append(task)

    def at(self, at_s: float, do: Callable[[], None]) -> None:
        """Do something at an instant."""
        self._count += 1
        heapq.heappush(self._alarms, (at_s, self._count, do))

    def after(self, in_s: float, do: Callable[[], None]) -> None:
        """Do something after a time."""
        self.at(self.now_s + in_s, do)

    def leave(self) -> None:
        """The world is over; what has not come to its end never does."""
        _never_resumed.extend(task for task in self.tasks if not task.is_over)

    def wake(self, task: Task) -> None:
        """End the wait of a task, if it waits."""
        task.woken = True
        self.make_ready(task)

    def pause(self, until_s: float | None = None) -> bool:
        """Wait until somebody wakes this task, or that instant; whether somebody did."""
        task = getcurrent()
        assert isinstance(task, Task)
        task.woken = False
        task.waits += 1
        if until_s is not None:
            if until_s <= self.now_s:
                self.make_ready(task)
            else:
                this = task.waits
                self.at(until_s, lambda: self.make_ready(task) if task.waits == this else None)
        self.greenlet.switch()
        return task.woken

    def point(self) -> None:
        """A call of the seam: a moment in which another task may get its turn, and the process hears its signals."""
        self.calls += 1
        self.now_s += self._step_s
        task = getcurrent()
        if self._random() < self._hurry:
            task.waits += 1  # type: ignore[attr-defined]
            self.make_ready(task)  # type: ignore[arg-type]
            self.greenlet.switch()
        owner = task.owner  # type: ignore[attr-defined]
        if owner.pending:
            owner.hear()

    def run(self, until_s: float, is_over: Callable[[], bool] = lambda: False) -> None:
        """Let the world go on, from the outside: until an instant, or until it is over, or nothing is left to do."""
        ready, alarms = self._ready, self._alarms
        while not is_over():
            while alarms and alarms[0][0] <= self.now_s:
                heapq.heappop(alarms)[2]()
            if ready:
                at = self.draw.randrange(len(ready)) if len(ready) > 1 else 0
                task, ready[at] = ready[at], ready[-1]
                ready.pop()
                task.is_ready = False
                if task.is_over or (task.owner is not None and not task.owner.may_work(task)):
                    continue
                task.switch()
            elif alarms and alarms[0][0] <= until_s:
                self.now_s = alarms[0][0]
            else:
                self.now_s = max(self.now_s, until_s)
                return


class Waiters:
    """Tasks that wait for one thing."""

    def __init__(self, hub: Hub) -> None:
        self._hub, self._tasks = hub, deque[Task]()

    def wait(self, until_s: float | None = None) -> bool:
        """Wait; whether woken in time."""
        task = getcurrent()
        self._tasks.append(task)
        try:
            return self._hub.pause(until_s)
        finally:
            if task in self._tasks:
                self._tasks.remove(task)

    def add(self, task: Task) -> None:
        """Have this one wake them too, which waits for something else as well."""
        self._tasks.append(task)

    def wake(self) -> None:
        """All of them look again."""
        while self._tasks:
            self._hub.wake(self._tasks.popleft())


class Lock:
    """As `threading.Lock` and `threading.RLock`; every acquiring is a call of the seam.

    Args:
        call: of the seam: done before anything else.
    """

    def __init__(self, hub: Hub, call: Callable[[], None], *, again: bool = False) -> None:
        self._hub, self._call, self._again = hub, call, again
        self._owner: Any = None
        self._depth = 0
        self._waiters = Waiters(hub)

    def acquire(self, blocking: bool = True, timeout: float = -1.0) -> bool:
        self._call()
        me, until_s = getcurrent(), None if timeout < 0.0 else self._hub.now_s + timeout
        if self._owner is me and self._again:
            self._depth += 1
            return True
        while self._owner is not None:
            if not blocking or (until_s is not None and self._hub.now_s >= until_s):
                return False
            self._waiters.wait(until_s)
            self._call()
        self._owner, self._depth = me, 1
        return True

    def release(self) -> None:
        self._depth -= 1
        if not self._depth:
            self._owner = None
            self._waiters.wake()

    def locked(self) -> bool:
        return self._owner is not None

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()


class Event:
    """As `threading.Event`."""

    def __init__(self, hub: Hub, call: Callable[[], None]) -> None:
        self._hub, self._call, self._is_set, self._waiters = hub, call, False, Waiters(hub)

    def is_set(self) -> bool:
        return self._is_set

    def set(self) -> None:
        self._call()
        self._is_set = True
        self._waiters.wake()

    def clear(self) -> None:
        self._call()
        self._is_set = False

    def wait(self, timeout: float | None = None) -> bool:
        self._call()
        until_s = None if timeout is None else self._hub.now_s + timeout
        while not self._is_set and (until_s is None or self._hub.now_s < until_s):
            self._waiters.wait(until_s)
            self._call()
        return self._is_set


class Queue:
    """As `queue.SimpleQueue`."""

    def __init__(self, hub: Hub, call: Callable[[], None]) -> None:
        self._hub, self._call, self._items, self._waiters = hub, call, deque[Any](), Waiters(hub)

    def put(self, item: Any) -> None:
        self._call()
        self._items.append(item)
        self._waiters.wake()

    def get(self, block: bool = True, timeout: float | None = None) -> Any:
        self._call()
        until_s = None if timeout is None else self._hub.now_s + timeout
        while not self._items:
            if not block or (until_s is not None and self._hub.now_s >= until_s):
                raise Empty
            self._waiters.wait(until_s)
            self._call()
        return self._items.popleft()

    def get_nowait(self) -> Any:
        return self.get(block=False)

    def empty(self) -> bool:
        return not self._items


class Thread:
    """As `threading.Thread`: one that keeps no process from ending; also as `threading.Timer`, with a delay."""

    def __init__(
        self, hub: Hub, call: Callable[[], None], run: Callable[[], object], owner: Any, name: str, delay_s: float = 0.0
    ) -> None:
        self._hub, self._call, self._do, self._owner, self._delay_s = hub, call, run, owner, delay_s
        self.name, self.task, self._is_cancelled = name, None, False

    def start(self) -> None:
        self._call()
        self.task = self._hub.spawn(self._run, self._owner, self.name)
        self._owner.tasks.append(self.task)

    def _run(self) -> None:
        if self._delay_s:
            self._hub.pause(self._hub.now_s + self._delay_s)
        if not self._is_cancelled:
            self._do()

    def cancel(self) -> None:
        self._is_cancelled = True
        if self.task is not None:
            self._hub.wake(self.task)

    def is_alive(self) -> bool:
        return self.task is not None and not self.task.is_over

    def join(self, timeout: float | None = None) -> None:
        self._call()
        until_s = None if timeout is None else self._hub.now_s + timeout
        while self.is_alive() and (until_s is None or self._hub.now_s < until_s):
            self.task.watchers.append(getcurrent())
            self._hub.pause(until_s)
            self._call()
