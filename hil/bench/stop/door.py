"""The door of a server: so many connections at a time, and those that ask for nothing go first."""

from __future__ import annotations

import asyncio
import socket
import ssl
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Protocol

Listening = tuple[socket.socket, ssl.SSLContext | None]
_HANDSHAKE_S = 2.0
FLUSH_S = 0.3  # for the last of an answer, once it is closed
AGAIN_S = 0.05


class Visitor(Protocol):
    """An asyncio protocol, as far as a door deals with it.

    Attributes:
        transport: of asyncio; None until it is connected.
        gone: to be called when the connection is lost; the door sets it.
    """

    transport: Any
    gone: Callable[[], None]

    @property
    def waits(self) -> bool:
        """Whether a request of it is there whole, and its answer is not."""

    @property
    def has_asked(self) -> bool:
        """Whether a whole request of it ever came."""


class Door:
    """Takes the connections of sockets, within the running loop, until it is closed.

    When more come than there is room for, the oldest goes of those that are more: that wait for an answer, or that
    do not. Who floods a server with connections that say nothing, or with answers that never end, loses those.

    Args:
        sockets: that listen, each with its certificate.
        made: makes the protocol of a connection.
        most: connections at a time.
        says_s: so long a new connection has until its first request is there whole.
        dropped: called for each that was hung up on.
    """

    def __init__(
        self, sockets: Iterable[Listening], made: Callable[[], Visitor], most: int, says_s: float,
        dropped: Callable[[], None] = lambda: None,
    ) -> None:  # fmt: skip
        self._made, self._most, self._says_s, self._dropped = made, most, says_s, dropped
        self._open: dict[Visitor, asyncio.Task[None]] = {}
        self._loop = asyncio.get_running_loop()
        self._taking = [self._loop.create_task(self._accept(*one)) for one in sockets]

    @property
    def is_busy(self) -> bool:
        """Whether an answer is under way."""
        return any(visitor.waits for visitor in self._open)

    def close(self) -> None:
        """Take no more; what is under way goes on."""
        for task in self._taking:
            task.cancel()

    async def _accept(self, listening: socket.socket, tls: ssl.SSLContext | None) -> None:
        listening.setblocking(False)
        while True:
            try:
                taken, _peer = await self._loop.sock_accept(listening)
            except OSError:  # no descriptor is left, or the caller has gone
                self._drop_one()
                await asyncio.sleep(AGAIN_S)
                continue
            visitor = self._made()
            visitor.gone = partial(self._forget, visitor)
            meeting = self._open[visitor] = self._loop.create_task(self._connect(visitor, taken, tls))
            meeting.add_done_callback(partial(_let_go, visitor, taken))
            if len(self._open) > self._most:
                self._drop_one()
            await asyncio.sleep(0)  # those that are there are heard between two that come

    async def _connect(self, visitor: Visitor, taken: socket.socket, tls: ssl.SSLContext | None) -> None:
        """Connect it, and give it a moment to say what it wants."""
        limit = {"ssl_handshake_timeout": _HANDSHAKE_S, "ssl_shutdown_timeout": FLUSH_S} if tls else {}
        try:
            await self._loop.connect_accepted_socket(lambda: visitor, taken, ssl=tls, **limit)  # type: ignore[arg-type,type-var] # it is one
        except (OSError, asyncio.CancelledError):
            self._forget(visitor)
            return
        await asyncio.sleep(self._says_s)
        if not visitor.has_asked:
            self._drop(visitor)

    def _drop_one(self) -> None:
        waiting = [visitor for visitor in self._open if visitor.waits]
        more = waiting if 2 * len(waiting) > len(self._open) else [one for one in self._open if not one.waits]
        if more:
            self._drop(more[0])

    def _drop(self, visitor: Visitor) -> None:
        self._dropped()
        if visitor.transport is not None:
            visitor.transport.abort()
        self._forget(visitor)

    def _forget(self, visitor: Visitor) -> None:
        task = self._open.pop(visitor, None)
        if task is not None and task is not asyncio.current_task():
            task.cancel()


def _let_go(visitor: Visitor, taken: socket.socket, _meeting: asyncio.Task[None]) -> None:
    """Close what nobody speaks through: also where the task was cancelled before its first step."""
    if visitor.transport is None:
        taken.close()
