"""The listener: takes a stop over HTTP and answers within a second with what was read back at the devices.

It lives in a thread of its own, in the watchdog process where there is one. It holds nothing that the process needs:
connections are few at a time, each has a moment to say what it wants, and whatever comes in cannot end the thread.
"""

from __future__ import annotations

import asyncio
import hmac
import socket
import ssl
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress

from hil.bench.stop.consoles import Console, consoles, may_read
from hil.bench.stop.control import Control, Tokens, vouched
from hil.bench.stop.door import AGAIN_S, FLUSH_S, Door, Listening
from hil.bench.stop.request import BadRequestError, Request, request_in, response
from hil.bench.stop.stop_service import By, StopService
from hil.system import system

ANSWER_S = 0.85  # the page has its answer within a second, whatever the devices do
_SAYS_S = 2.0  # so long a connection has to say what it wants
_MOST = 128  # connections at a time
_QUEUED = 512


class Listener:
    """Listens in a thread of its own until it is closed.

    On loopback, and wherever a console of this computer is reached from others, at its host and with its certificate.

    Args:
        service: where requests go.
        by: in which process this is.

    Raises:
        OSError: no port can be had on this computer.
    """

    def __init__(self, service: StopService, by: By) -> None:
        self.service = service
        self._tokens = Tokens()
        self._sockets, urls = _opened()
        self._ended = system.event()
        self._wake: Callable[[], object] | None = None
        self.control = Control(by, urls, self._tokens)
        self._thread = system.thread(self._run, name="hil-stop")
        self._thread.start()

    def close(self) -> None:
        """End it; who waits is answered with what is known, and answers that are under way are given a moment."""
        self.service.close()
        self._ended.set()
        with suppress(RuntimeError):  # its loop is between two lives
            if self._wake is not None:
                self._wake()
        self._thread.join(2.0 * FLUSH_S)
        for opened, _tls in self._sockets:
            opened.close()

    def _run(self) -> None:
        while not self._ended.is_set():
            try:
                asyncio.run(self._serve())
            except BaseException:  # nothing that arrives here may end the listener
                self._ended.wait(AGAIN_S)

    async def _serve(self) -> None:
        loop, end = asyncio.get_running_loop(), asyncio.Event()
        self._wake = lambda: loop.call_soon_threadsafe(end.set)
        loop.set_exception_handler(lambda _loop, _context: None)
        door = Door(self._sockets, lambda: _Connection(self._answer), _MOST, _SAYS_S)
        if not self._ended.is_set():
            await end.wait()
        door.close()
        until_s = system.now_s() + FLUSH_S
        while door.is_busy and system.now_s() < until_s:
            await asyncio.sleep(0.005)

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
        if request.path == "/hold":
            return 200, self._hold_answer(request.fields.get("hold", ""))
        return 200, await self._stopped(self._account(request.fields))

    def _account(self, fields: Mapping[str, str]) -> str:
        """Who asks, where a console vouches for it: whoever knows the token for a stop may say any name."""
        account = fields.get("account", "")
        voucher = fields.get("vouched", "").encode()
        return account if hmac.compare_digest(voucher, vouched(account, self._tokens.hold).encode()) else ""

    async def _stopped(self, by: str) -> object:
        since_s = system.now_s()
        asked = self.service.stop(by)
        try:
            status = await asyncio.wait_for(asyncio.wrap_future(asked), ANSWER_S)
        except TimeoutError:
            self.service.give_up(asked)
            return {**self.service.status.answer(since_s), "state": "unconfirmed", "seconds": ANSWER_S}
        return status.answer(since_s)

    def _hold_answer(self, hold: str) -> object:
        if hold in ("1", "0"):
            self.service.ask_to_hold(hold == "1")
        elif hold:
            raise BadRequestError(400, f"hold {hold:.20}: 1, 0, or nothing to ask how it stands")
        return {"state": self.service.hold}


class _Connection(asyncio.Protocol):
    """One connection, from being taken to its answer.

    Attributes:
        transport: None until it may speak.
        gone: called when it is over.
    """

    def __init__(self, answer: Callable[[Request], Awaitable[bytes]]) -> None:
        self._answer = answer
        self._received = b""
        self._answering: asyncio.Task[None] | None = None
        self.transport: asyncio.Transport | None = None
        self.gone: Callable[[], None] = lambda: None

    @property
    def waits(self) -> bool:
        """Whether its request is there, and its answer is not."""
        return self._answering is not None and not self._answering.done()

    @property
    def has_asked(self) -> bool:
        """Whether its request came; it asks once."""
        return self._answering is not None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """It may speak."""
        self.transport = transport  # type: ignore[assignment] # of a socket, so it writes

    def data_received(self, data: bytes) -> None:
        """Some of its request came."""
        if self._answering is not None:
            return
        self._received += data
        try:
            request = request_in(self._received)
        except BadRequestError as error:
            self._send(response(error.status, {"error": str(error)}))
            return
        if request is not None:
            self._answering = asyncio.get_running_loop().create_task(self._answered(request))

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 # as asyncio calls it
        """It is gone; a stop that it asked for goes on."""
        self.gone()

    async def _answered(self, request: Request) -> None:
        try:
            self._send(await self._answer(request))
        except Exception:  # a fault of this program: hung up on, and the next is heard
            if self.transport is not None:
                self.transport.abort()

    def _send(self, answer: bytes) -> None:
        if self.transport is not None and not self.transport.is_closing():
            self.transport.write(answer)
            self.transport.close()


def _opened() -> tuple[list[Listening], tuple[str, ...]]:
    """Sockets that listen, and the address of each: on this computer, and where consoles are reached from others.

    A console of which no more can be had keeps no run from being stopped: its pages ask its server to do that.
    """
    sockets, urls = [], []
    away = {(console.host, console.cert): console for console in consoles() if console.is_reached_from_network}
    for console in (None, *away.values()):
        host = console.host if console else "127.0.0.1"
        try:
            tls = _certificate(console) if console else None
            opened = socket.create_server(
                (host, 0), family=socket.AF_INET6 if ":" in host else socket.AF_INET, backlog=_QUEUED
            )
        except OSError:
            if console is None:
                raise
            continue
        sockets.append((opened, tls))
        written = f"[{host}]" if ":" in host else host
        urls.append(f"{'https' if tls else 'http'}://{written}:{opened.getsockname()[1]}")
    return sockets, tuple(urls)


def _certificate(console: Console) -> ssl.SSLContext:
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(console.cert, console.key)
    return context
