"""Instruments on HiSLIP (IVI-6.1) and VXI-11 (with its own RPC), written from the specifications alone."""

from __future__ import annotations

import queue
import socket
import struct
import threading
from contextlib import suppress
from types import SimpleNamespace
from typing import Any, ClassVar

from sim_devices._field import Side
from sim_devices._lines_of_text import TextDevice
from sim_devices._quirks import Quirks
from sim_devices._stream import StreamServer, TcpServer

_HEADER = struct.Struct("!2sBBIQ")  # of HiSLIP: "HS", type, control code, parameter, length
_INITIALIZE, _DATA, _DATA_END, _CLEAR_COMPLETE, _MAX_SIZE, _ASYNC_INITIALIZE, _ASYNC_CLEAR = 0, 6, 7, 8, 15, 17, 19
_CREATE, _WRITE, _READ, _CLEAR, _DESTROY = 10, 11, 12, 15, 23  # of VXI-11
_IO_TIMEOUT, _END, _NO_SUCH_PROCEDURE = 15, 4, 3


class _Server(TcpServer):
    @property
    def sockets(self) -> list[socket.socket]:
        """On which it listens and answers."""
        return [self.listener.socket, *self.clients]


class HislipServer(_Server):
    """An instrument on HiSLIP: a synchronous and an asynchronous connection."""

    def __init__(self, device: TextDevice, side: Side, quirks: Quirks, host: str, port: int) -> None:
        super().__init__(device, side, quirks, host, port)
        self.where = f"TCPIP::{self.host}::hislip0,{self.port}::INSTR"

    def _serve_client(self, client: socket.socket) -> None:
        with suppress(OSError, EOFError), client:
            message = b""
            while True:
                _, kind, _, number, length = _HEADER.unpack(_exactly(client, _HEADER.size))
                payload = _exactly(client, length)

                def send(kind: int, number: int, payload: bytes = b"") -> None:
                    client.sendall(_HEADER.pack(b"HS", kind, 0, number, len(payload)) + payload)

                if kind == _INITIALIZE:
                    send(1, 0x0100_0001)
                elif kind in (_ASYNC_INITIALIZE, _ASYNC_CLEAR):
                    send({_ASYNC_INITIALIZE: 18, _ASYNC_CLEAR: 23}[kind], 0)
                elif kind == _MAX_SIZE:
                    send(16, 0, payload)
                elif kind == _CLEAR_COMPLETE:
                    message = b""
                    send(9, 0)
                elif kind in (_DATA, _DATA_END):
                    message += payload
                    if kind == _DATA_END:
                        whole, message = message, b""
                        self._reply(whole, lambda answer, number=number: send(_DATA_END, number, answer))


class _Fetched(StreamServer):
    """An instrument whose answers wait until they are fetched.

    A device clear forgets them, and what it was asked and has not answered yet (IEEE 488.2, 5.8).
    """

    def __init__(self, device: TextDevice, side: Side, quirks: Quirks, *where: Any) -> None:
        self._says, self._change, self._clears = b"", threading.Condition(), 0
        self._told: queue.Queue[tuple[int, bytes]] = queue.Queue()
        super().__init__(device, side, quirks, *where)
        self._start(self._obey)

    def tell(self, message: bytes) -> None:
        """One whole message; it is obeyed soon."""
        self._told.put((self._clears, message))

    def fetch(self, wait_s: float) -> bytes:
        """What it has to say, waited for so long."""
        with self._change:
            self._change.wait_for(lambda: self._says, wait_s)
            says, self._says = self._says, b""
        return says

    def clear(self) -> None:
        """Device clear."""
        with self._change:
            self._says = b""
            self._clears += 1

    def _obey(self) -> None:
        while not self._ended.is_set():
            with suppress(queue.Empty):
                clears, message = self._told.get(timeout=0.2)
                self._reply(message, lambda answer, clears=clears: self._say(answer, clears))

    def _say(self, answer: bytes, clears: int) -> None:
        with self._change:
            self._says += answer if clears == self._clears else b""
            self._change.notify_all()


class Vxi11Server(_Fetched, _Server):
    """An instrument on VXI-11, at its port without a port mapper."""

    def __init__(self, device: TextDevice, side: Side, quirks: Quirks, host: str, port: int) -> None:
        super().__init__(device, side, quirks, host, port)
        self.where = f"TCPIP::{self.host},{self.port}::INSTR"

    def _serve_client(self, client: socket.socket) -> None:
        with suppress(OSError, EOFError), client:
            while True:
                (mark,) = struct.unpack("!I", _exactly(client, 4))
                call = _exactly(client, mark & 0x7FFF_FFFF)
                number, _, _, _, _, procedure = struct.unpack("!6I", call[:24])
                rest = call[24:]
                for _ in range(2):  # credential and verifier
                    rest = rest[8 + struct.unpack("!I", rest[4:8])[0] :]
                result = self._done(procedure, rest)
                accepted = 0 if result is not None else _NO_SUCH_PROCEDURE
                reply = struct.pack("!6I", number, 1, 0, 0, 0, accepted) + (result or b"")
                client.sendall(struct.pack("!I", 0x8000_0000 | len(reply)) + reply)

    def _done(self, procedure: int, arguments: bytes) -> bytes | None:
        if procedure == _CREATE:
            return struct.pack("!4I", 0, 7, 0, 4096)
        if procedure == _WRITE:
            (length,) = struct.unpack("!I", arguments[16:20])
            self.tell(arguments[20 : 20 + length])
            return struct.pack("!2I", 0, length)
        if procedure == _READ:
            says = self.fetch(struct.unpack("!I", arguments[8:12])[0] / 1000.0)
            head = (0, _END) if says else (_IO_TIMEOUT, 0)
            return struct.pack("!3I", *head, len(says)) + says + bytes(-len(says) % 4)
        if procedure == _CLEAR:
            self.clear()
        return struct.pack("!I", 0) if procedure in (_CLEAR, _DESTROY) else None


class AtTheSeam(_Fetched):
    """An instrument on USBTMC or GPIB as pyvisa hands it out: whole messages, no connection behind them."""

    there: ClassVar[dict[str, AtTheSeam]] = {}

    def __init__(self, device: TextDevice, side: Side, quirks: Quirks, address: str) -> None:
        super().__init__(device, side, quirks, address)
        self.there[address] = self

    def close(self) -> None:
        """It is unplugged."""
        self.there.pop(self.where, None)
        super().close()


class Resource:
    """What `hil.system.System.visa` gives."""

    def __init__(self, name: str, _timeout_s: float) -> None:
        self._server = AtTheSeam.there[name]
        self.timeout, self.session = 0, 0
        self.visalib = SimpleNamespace(sessions=[SimpleNamespace(interface=SimpleNamespace())])
        self.clear, self.write_raw = self._server.clear, self._server.tell

    def read_raw(self) -> bytes:
        """One message."""
        if not (says := self._server.fetch(self.timeout / 1000.0)):
            from pyvisa.constants import StatusCode
            from pyvisa.errors import VisaIOError

            raise VisaIOError(StatusCode.error_timeout)
        return says

    def close(self) -> None:
        """Let go of it."""


def serve(device: TextDevice, side: Side, quirks: Quirks, address: str) -> StreamServer:
    """Like `sim_devices._stream.serve_stream`, at the port that an address of VISA has, or at the seam."""
    if not address.startswith("TCPIP"):
        return AtTheSeam(device, side, quirks, address)
    kind = HislipServer if "hislip" in address else Vxi11Server
    port = int(address.removesuffix("::INSTR").rpartition(",")[2])
    return kind(device, side, quirks, "127.0.0.1", port)


def _exactly(client: socket.socket, length: int) -> bytes:
    came = b""
    while len(came) < length:
        try:
            more = client.recv(length - len(came))
        except TimeoutError:  # a server looks up now and then
            continue
        if not more:
            raise EOFError
        came += more
    return came
