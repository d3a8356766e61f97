"""Byte streams on which simulated devices answer: a TCP port, or one end of a pseudo terminal."""

from __future__ import annotations

import os
import queue
import select
import socket
import threading
import time
import tty
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import ClassVar, Protocol

from hil.daq.address import is_visa
from hil.errors import FileError
from sim_devices._field import Side
from sim_devices._listener import Listener
from sim_devices._quirks import Behaviour, Quirks

_CHUNK = 4096
_TICK_S = 0.01
_APART_S = 0.02  # two answers, so that the first one is there alone
_LONGEST_REQUEST = 4096  # bytes without a whole request in them are thrown away beyond this


class Device(Protocol):
    """What is behind a stream: it answers requests."""

    def request_in(self, received: bytes) -> tuple[bytes, bytes]:
        """The first whole request in what was received, and what is left; empty while none is whole."""
        ...

    def answer(self, request: bytes) -> bytes:
        """The answer to one request, empty if there is none."""
        ...

    def restart(self) -> None:
        """Be as after power-on."""
        ...

    def tick(self) -> None:
        """Look at the clock; called all the time, whether anybody asks or not."""
        ...


class StreamServer:
    """Serves one device to whoever connects, in threads of its own, until it is closed.

    Attributes:
        where: where it listens, as a driver's settings name it.
        behaviour: its quirks, which may be changed at any time.
        device: what answers; side: its terminals.
    """

    def __init__(self, device: Device, side: Side, quirks: Quirks, where: str) -> None:
        self.where = where
        self.behaviour = Behaviour(quirks)
        self.device = device
        self.side = side
        self._busy, self._before = threading.Lock(), b""
        self._ended = threading.Event()
        self._threads: list[threading.Thread] = []
        self._start(self._tick)

    def close(self) -> None:
        """Stop answering. May be called twice."""
        self._ended.set()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(2.0)

    def _start(self, run: Callable[..., None], *args: object) -> None:
        thread = threading.Thread(target=run, args=args, name="hil-device", daemon=True)
        self._threads = [other for other in self._threads if other.is_alive()] + [thread]
        thread.start()

    def _tick(self) -> None:
        while not self._ended.wait(_TICK_S):
            with self._busy:
                self.device.tick()

    def _serve(self, read: Callable[[], bytes | None], write: Callable[[bytes], object]) -> None:
        """Answer on one stream until it ends (`read` gives None)."""
        received = b""
        while not self._ended.is_set():
            more = read()
            if more is None:
                return
            received += more
            while True:
                request, received = self.device.request_in(received)
                if not request:
                    break
                self._pace(len(request))
                self._reply(request, write)
            if len(received) > _LONGEST_REQUEST:
                received = b""

    def _reply(self, request: bytes, write: Callable[[bytes], object]) -> None:
        quirks = self.behaviour.next_answer()
        with self._busy:
            self.side.quirks = quirks
            if quirks.reboot:
                self.device.restart()
                return
            answer = self.device.answer(request)
        if quirks.late_s and self._ended.wait(quirks.late_s):
            return
        if quirks.again:
            write(self._before)
            self._ended.wait(_APART_S)
        self._before = sent = self.behaviour.mangled(answer, quirks)
        self._pace(len(sent))
        if sent:
            write(sent)

    def _pace(self, count: int) -> None:
        """The time that so many bytes take on a line of limited speed."""
        baud = self.behaviour.quirks.baud
        if baud is not None and count:
            time.sleep(10.0 * count / baud)


class TcpServer(StreamServer):
    """A device on a TCP port; several clients may connect, their requests are answered one after the other.

    Attributes:
        listener: on which they come; clients: those that are connected.

    Raises:
        FileError: the port is taken.
    """

    def __init__(self, device: Device, side: Side, quirks: Quirks, host: str, port: int) -> None:
        self.listener = Listener(host, port)
        self.host, self.port = self.listener.host, self.listener.port
        super().__init__(device, side, quirks, f"{self.host}:{self.port}")
        self.clients: list[socket.socket] = []
        self._start(self._accept)

    def close(self) -> None:
        """Stop listening and drop every client."""
        self._ended.set()
        self.listener.close()
        self.drop()
        super().close()

    def drop(self) -> None:
        """Drop every client, as when a cable is pulled."""
        for client in self.clients:
            with suppress(OSError):
                client.shutdown(socket.SHUT_RDWR)
            client.close()
        self.clients = []

    def _accept(self) -> None:
        for client in self.listener.clients():
            client.settimeout(0.2)
            self.clients.append(client)
            self._start(self._serve_client, client)

    def _serve_client(self, client: socket.socket) -> None:
        def read() -> bytes | None:
            try:
                return client.recv(_CHUNK) or None
            except TimeoutError:
                return b""
            except OSError:
                return None

        with suppress(OSError), client:
            self._serve(read, client.sendall)


class PtyServer(StreamServer):
    """A device on a pseudo terminal, reached through a link of the asked name, as a serial port has one.

    Several of one process may be on one, as on an RS-485 line: each hears every request.

    Raises:
        FileError: something of that name exists already.
    """

    def __init__(self, device: Device, side: Side, quirks: Quirks, name: str) -> None:
        self._pty = _Pty.at(name)
        self._heard: queue.Queue[bytes] = queue.Queue()
        super().__init__(device, side, quirks, name)
        self._pty.join(self._heard)
        self._start(self._serve, self._read, self._pty.write)

    def close(self) -> None:
        """Take the port away, if nobody else is on it."""
        first = not self._ended.is_set()
        super().close()
        if first:
            self._pty.leave(self._heard)

    def _read(self) -> bytes | None:
        try:
            return self._heard.get(timeout=0.2)
        except queue.Empty:
            return None if self._pty.is_gone else b""


def serve_stream(device: Device, side: Side, quirks: Quirks, address: str) -> StreamServer:
    """Serve a device on a TCP port (`socket://host:port`) or a pseudo terminal of that name.

    Raises:
        FileError: it cannot be served there.
    """
    if is_visa(address):
        raise FileError(
            f'{address}: no twin is reached by VISA; in a copy of the file say address = "socket://127.0.0.1:5025"'
        )
    scheme, slashes, place = address.partition("://")
    if not slashes:
        return PtyServer(device, side, quirks, address)
    host, _, port = place.rpartition(":")
    server = TcpServer(device, side, quirks, host, int(port))
    server.where = f"{scheme}://{server.where}"
    return server


class _Pty:
    """A pseudo terminal and who is on it."""

    _all: ClassVar[dict[str, _Pty]] = {}
    _registry: ClassVar[threading.Lock] = threading.Lock()

    def __init__(self, name: str) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._master)
        tty.setraw(self._slave)
        self._name = Path(name)
        try:
            self._name.symlink_to(os.ttyname(self._slave))
        except OSError as error:
            os.close(self._master)
            os.close(self._slave)
            raise FileError(f"{name}: cannot be made a serial port: {error.strerror}") from None
        self.is_gone = False
        self.listeners: list[queue.Queue[bytes]] = []
        self._thread = threading.Thread(target=self._run, name="hil-pty", daemon=True)

    @classmethod
    def at(cls, name: str) -> _Pty:
        """That of this name, made if there is none."""
        with cls._registry:
            if name not in cls._all:
                cls._all[name] = cls(name)
            return cls._all[name]

    def join(self, heard: queue.Queue[bytes]) -> None:
        """Hand on what comes from now on."""
        self.listeners = [*self.listeners, heard]
        if not self._thread.ident:
            self._thread.start()

    def leave(self, heard: queue.Queue[bytes]) -> None:
        """Hand on no more; who leaves last takes the port away."""
        with self._registry:
            self.listeners = [one for one in self.listeners if one is not heard]
            if self.listeners:
                return
            self._all.pop(str(self._name), None)
        self.is_gone = True
        self._thread.join(2.0)
        self._name.unlink(missing_ok=True)
        os.close(self._master)
        os.close(self._slave)

    def write(self, answer: bytes) -> None:
        """Put an answer on the line."""
        os.write(self._master, answer)

    def _run(self) -> None:
        while not self.is_gone:
            ready, _, _ = select.select([self._master], [], [], 0.2)
            try:
                came = os.read(self._master, _CHUNK) if ready else b""
            except OSError:
                self.is_gone = True
                return
            for one in self.listeners if came else ():
                one.put(came)
