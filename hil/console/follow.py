"""One reader of a run's folder for all who look on: what is new is made once, and every viewer gets the same bytes."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import AsyncIterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from hil.console.bode import bode_point
from hil.console.envelope import COARSE_KEPT, FINE_KEPT, FINE_S, Envelope
from hil.console.underway import run_of
from hil.errors import FileError
from hil.record.run_folder.tail import Tail

PICTURE_S = 0.05
_QUIET_S = 1.0  # so long nothing new: the viewer is told that the server is there
_BEHIND = 200  # pictures that a viewer may be behind before it is let go


class Follower:
    """Follows a run from its first sample to its end.

    Args:
        folder: of the run.
        pid: of its process, where this console started it.

    Attributes:
        run: how it stood when it was looked at last.
    """

    def __init__(self, folder: Path, pid: int | None = None) -> None:
        self._tail = Tail(folder)
        self._pid = pid
        self.folder = folder
        columns = self._tail.header.samples.columns[1:]
        self.channels = [{"name": column.name, "unit": column.unit} for column in columns]
        self._fine = Envelope(len(columns), FINE_S, FINE_KEPT, merges=False)
        self._coarse = Envelope(len(columns), FINE_S, COARSE_KEPT, merges=True)
        self._rows = 0
        self._last_s: float | None = None
        self._values: list[float | None] = [None] * len(columns)
        self._events: list[dict[str, Any]] = []
        self._details: dict[int, dict[str, Any]] = {}
        self._bode: list[dict[str, Any]] = []
        self.run = run_of(folder, pid)
        self._polls = 0
        self._caught_up = False
        self._lock = threading.Lock()

    @property
    def finished(self) -> bool:
        """Nothing more will come."""
        return self.run.state != "running" and self._caught_up

    def look(self) -> dict[str, Any] | None:
        """What is new, as a picture; None when nothing is. Raises `FileError` when the folder went away."""
        with self._lock:
            return self._look()

    def _look(self) -> dict[str, Any] | None:
        self._polls += 1
        run = run_of(self.folder, self._pid)
        changed, self.run = run.state != self.run.state, run
        since_s = self._fine.last_s
        rows, events, points = self._take_samples(), *self._take_events()
        self._caught_up = not rows
        if not (rows or events or points or changed):
            return None
        return {
            **self._state(), "fine": self._fine.since(since_s), "events": events, "bode": points,
        }  # fmt: skip

    def snapshot(self) -> dict[str, Any]:
        """Everything so far, for a viewer who has just come."""
        with self._lock:
            return {
                **self._state(), "channels": self.channels, "fine": self._fine.since(-np.inf),
                "coarse": self._coarse.since(-np.inf), "events": list(self._events), "bode": list(self._bode),
            }  # fmt: skip

    def _state(self) -> dict[str, Any]:
        return {
            "seq": self._polls, "run": self.folder.name, "state": self.run.state, "outcome": self.run.outcome,
            "rows": self._rows,
            "time_s": self._last_s, "values": self._values,
        }  # fmt: skip

    def _take_samples(self) -> int:
        taken = 0
        while len(new := self._tail.samples()):
            values = np.vstack([channel.values for channel in new.channels.values()])
            self._fine.take(new.time_s, values)
            self._coarse.take(new.time_s, values)
            taken += len(new)
            self._last_s = float(new.time_s[-1])
            self._values = [float(f"{v:.6g}") if np.isfinite(v) else None for v in values[:, -1].tolist()]
        self._rows += taken
        return taken

    def _take_events(self) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
        events, points = [], []
        for event in self._tail.events():
            details = event["details"]
            if "part" in event:
                self._details[event["part"]] = {**self._details.get(event["part"], {}), **details}
                if event["event"] == "part stopped" and (point := bode_point(self._details.pop(event["part"]))):
                    points.append(point)
                continue
            events.append({"event": event["event"], "time_s": event.get("time_s"), "details": details})
        self._events += events
        self._bode += points
        return events, points


class Following:
    """Followers by run, each alive while somebody looks on."""

    def __init__(self) -> None:
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._followers: dict[str, Follower] = {}
        self._queues: dict[str, list[asyncio.Queue[bytes | None]]] = {}

    def close(self) -> None:
        """Tell everybody that no more comes."""
        for name in list(self._queues):
            self._send(name, None)

    async def pictures(self, folder: Path, pid: int | None = None) -> AsyncIterator[bytes]:
        """Server-sent events of a run: a snapshot, then what is new twenty times a second, until it is over.

        Raises:
            FileError: not a run folder.
        """
        name = folder.name
        if name not in self._followers:
            follower = await asyncio.to_thread(Follower, folder, pid)
            await asyncio.to_thread(follower.look)
            self._followers.setdefault(name, follower)
        follower = self._followers[name]
        queue: asyncio.Queue[bytes | None] = asyncio.Queue(_BEHIND)
        self._queues.setdefault(name, []).append(queue)
        try:
            yield _sent("snapshot", await asyncio.to_thread(follower.snapshot))
            if name not in self._tasks:
                self._tasks[name] = asyncio.create_task(self._follow(name, follower))
            while (picture := await queue.get()) is not None:
                yield picture
        finally:
            self._leave(name, queue)

    def _leave(self, name: str, queue: asyncio.Queue[bytes | None]) -> None:
        with suppress(KeyError, ValueError):
            self._queues[name].remove(queue)
            if not self._queues[name]:
                del self._queues[name]
                self._followers.pop(name, None)
                if task := self._tasks.pop(name, None):
                    task.cancel()

    async def _follow(self, name: str, follower: Follower) -> None:
        loop = asyncio.get_running_loop()
        sent_s = loop.time()
        while True:
            begun_s = loop.time()
            try:
                picture = await asyncio.to_thread(follower.look)
            except FileError as error:
                self._send(name, _sent("gone", {"why": str(error)}))
                break
            if picture is not None:
                self._send(name, _sent("picture", picture))
                sent_s = begun_s
            elif follower.finished:
                break
            elif begun_s - sent_s > _QUIET_S:
                self._send(name, _sent("quiet", {}))
                sent_s = begun_s
            await asyncio.sleep(max(0.0, begun_s + PICTURE_S - loop.time()))
        self._send(name, _sent("over", {}))
        self._send(name, None)

    def _send(self, name: str, picture: bytes | None) -> None:
        for queue in self._queues.get(name, []):
            if queue.full():  # it does not read: let it go, it may come again and gets a snapshot
                while not queue.empty():
                    queue.get_nowait()
                queue.put_nowait(None)
            else:
                queue.put_nowait(picture)


def _sent(kind: str, content: dict[str, Any]) -> bytes:
    text = json.dumps(content, separators=(",", ":"), ensure_ascii=False, allow_nan=False, default=str)
    return f"event: {kind}\ndata: {text}\n\n".encode()
