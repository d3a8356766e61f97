"""The listener: takes a stop over HTTP and answers within a second with what was read back at the devices.

It lives in a thread of its own, in the watchdog process where there is one. It holds nothing that the process needs:
connections are few at a time, each has a moment to say what it wants, and whatever comes in cannot end the thread. Who
floods it loses the connections that said nothing, oldest first; a whole request is answered at once.
"""

from __future__ import annotations

import asyncio
import hmac
import socket
import ssl
import threading
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress

from hil.bench.stop.consoles import Console, consoles, may_read
from hil.bench.stop.control import Control, Tokens
from hil.bench.stop.desk import By, Desk
from hil.bench.stop.request import BadRequestError, Request, request_in, response

ANSWER_S = 0.85  # the page has its answer within a second, whatever the devices do
_SAYS_S = 2.0  # so long a connection has to say what it wants
_MOST = 128  # connections at a time
_AT_ONCE = 16  # are taken before those that are there are heard again
_QUEUED = 512
_FLUSH_S = 0.3
_AGAIN_S = 0.05


class Listener:
    """Listens in a thread of its own until it is closed.

    On loopback; where a console of this computer is reached from elsewhere, at its host and with its certificate.

    Args:
        desk: where wishes go.
        by: in which process this is.

    Raises:
        OSError: no port can be had, or the console's certificate cannot be read.
    """

    def __init__(self, desk: Desk, by: By) -> None:
        self._desk = desk
        self._tokens = Tokens()
        self._socket, self._tls, where = _opened()
        self._open: dict[_Connection, None] = {}
        self._ended = threading.Event()
        self._wake: Callable[[], object] | None = None
        self.control = Control(by, where, self._tokens)
        self._thread = threading.Thread(target=self._run, name="hil-stop", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End it; answers that are under way are given a moment."""
        self._ended.set()
        with suppress(RuntimeError):  # its loop is between two lives
            if self._wake is not None:
                self._wake()
        self._thread.join(2.0 * _FLUSH_S)
        self._socket.close()

    def _run(self) -> None:
        while not self._ended.is_set():
            try:
                asyncio.run(self._serve())
            except BaseException:  # nothing that arrives here may end the listener
                self._ended.wait(_AGAIN_S)

    async def _serve(self) -> None:
        loop, end = asyncio.get_running_loop(), asyncio.Event()
        self._wake = lambda: loop.call_soon_threadsafe(end.set)
        loop.set_exception_handler(lambda _loop, _context: None)
        loop.add_reader(self._socket, self._accept, loop)
        if not self._ended.is_set():
            await end.wait()
        loop.remove_reader(self._socket)
        until_s = time.monotonic() + _FLUSH_S
        while any(connection.waits for connection in self._open) and time.monotonic() < until_s:
            await asyncio.sleep(0.005)

    def _accept(self, loop: asyncio.AbstractEventLoop) -> None:
        for _ in range(_AT_ONCE):
            try:
                near, _peer = self._socket.accept()
            except OSError:
                return
            near.setblocking(False)
            connection = _Connection(self._answer, self._open)
            self._open[connection] = None
            if len(self._open) > _MOST:
                self._drop_one()
            connection.begin(loop, near, self._tls)

    def _drop_one(self) -> None:
        """The oldest that has said nothing; else the oldest, whose stop is under way all the same."""
        silent = next((connection for connection in self._open if not connection.waits), None)
        (silent or next(iter(self._open))).drop()

    async def _answer(self, request: Request) -> bytes:
        origin = request.origin if may_read(request.origin) else ""
        if request.method == "OPTIONS":
            return response(204, None, origin)
        try:
            status, content = await self._done(request)
        except BadRequestError as error:
            status, content = error.status, {"error": str(error)}
        return response(status, content, origin)

    async def _done(self, request: Request) -> tuple[int, object]:
        token = {"/stop": self._tokens.stop, "/hold": self._tokens.hold}.get(request.path)
        if token is None:
            raise BadRequestError(404, "POST /stop, or POST /hold")
        if request.method != "POST":
            raise BadRequestError(405, "POST")
        if not hmac.compare_digest(request.fields.get("token", "").encode(), token.encode()):
            raise BadRequestError(403, "not the token of this run")
        return 200, await self._stopped() if request.path == "/stop" else self._held(request.fields.get("hold", ""))

    async def _stopped(self) -> object:
        since_s = time.monotonic()
        asked = self._desk.stop()
        try:
            told = await asyncio.wait_for(asyncio.wrap_future(asked), ANSWER_S)
        except TimeoutError:
            self._desk.give_up(asked)
            return {**self._desk.told.answer(since_s), "state": "unconfirmed", "seconds": ANSWER_S}
        return told.answer(since_s)

    def _held(self, hold: str) -> object:
        if hold in ("1", "0"):
            self._desk.ask_to_hold(hold == "1")
        elif hold:
            raise BadRequestError(400, f"hold {hold:.20}: 1, 0, or nothing to ask how it stands")
        return {"state": self._desk.hold}


class _Connection(asyncio.Protocol):
    """One connection, from being taken to its answer.

    Attributes:
        waits: whether its request is there and its answer is not.
    """

    def __init__(self, answer: Callable[[Request], Awaitable[bytes]], open_ones: dict[_Connection, None]) -> None:
        self._answer, self._open = answer, open_ones
        self._received = b""
        self._transport: asyncio.Transport | None = None
        self._tasks: list[asyncio.Task[object]] = []
        self._silent: asyncio.TimerHandle | None = None
        self.waits = False

    def begin(self, loop: asyncio.AbstractEventLoop, near: socket.socket, tls: ssl.SSLContext | None) -> None:
        """Take it over."""
        self._silent = loop.call_later(_SAYS_S, self.drop)
        self._tasks.append(loop.create_task(self._connected(loop, near, tls)))

    async def _connected(
        self, loop: asyncio.AbstractEventLoop, near: socket.socket, tls: ssl.SSLContext | None
    ) -> None:
        limit = {"ssl_handshake_timeout": _SAYS_S, "ssl_shutdown_timeout": _FLUSH_S} if tls else {}
        try:
            await loop.connect_accepted_socket(lambda: self, near, ssl=tls, **limit)
        except (OSError, asyncio.CancelledError):
            near.close()
            self._forget()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """It may speak."""
        self._transport = transport  # type: ignore[assignment] # of a socket, so it writes
        if self not in self._open:  # dropped meanwhile
            self.drop()

    def data_received(self, data: bytes) -> None:
        """Some of its request came."""
        if self.waits:
            return
        self._received += data
        try:
            request = request_in(self._received)
        except BadRequestError as error:
            self._send(response(error.status, {"error": str(error)}))
            return
        if request is not None:
            self.waits = True
            if self._silent is not None:
                self._silent.cancel()
            self._tasks.append(asyncio.get_running_loop().create_task(self._answered(request)))

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 # as asyncio calls it
        """It is gone; a stop that it asked for goes on."""
        self._forget()

    def drop(self) -> None:
        """Hang up."""
        if self._transport is not None:
            self._transport.abort()
        elif self._tasks:
            self._tasks[0].cancel()
        self._forget()

    async def _answered(self, request: Request) -> None:
        try:
            self._send(await self._answer(request))
        except Exception:  # a fault of this program: hung up on, and the next is heard
            self.drop()
        finally:
            self.waits = False

    def _send(self, answer: bytes) -> None:
        if self._transport is not None and not self._transport.is_closing():
            self._transport.write(answer)
            self._transport.close()

    def _forget(self) -> None:
        self._open.pop(self, None)
        if self._silent is not None:
            self._silent.cancel()


def _opened() -> tuple[socket.socket, ssl.SSLContext | None, str]:
    """A socket that listens, the certificate where there is one, and the address of both."""
    away = next((console for console in consoles() if console.is_reached_from_elsewhere), None)
    host = away.host if away else "127.0.0.1"
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    opened = socket.create_server((host, 0), family=family, backlog=_QUEUED)
    opened.setblocking(False)
    port = int(opened.getsockname()[1])
    written = f"[{host}]" if ":" in host else host
    if away is None:
        return opened, None, f"http://{written}:{port}"
    try:
        return opened, _certificate(away), f"https://{written}:{port}"
    except BaseException:
        opened.close()
        raise


def _certificate(console: Console) -> ssl.SSLContext:
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(console.cert, console.key)
    return context
