"""A device at the end of a TCP line that stands for itself: it shares no code with drivers or twins."""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import nullcontext, suppress
from types import TracebackType
from typing import Self

from tests import lost_packets

WholeRequest = Callable[[bytes], int]
"""How many of the bytes that have come are the first request; none while it is not whole."""


def ended(end: bytes) -> WholeRequest:
    """Requests that end with these bytes."""
    return lambda came: came.find(end) + len(end) if end in came else 0


def tcp_frame(came: bytes) -> int:
    """The request of Modbus TCP whose header says how long it is."""
    whole = 6 + int.from_bytes(came[4:6], "big")
    return whole if len(came) >= max(whole, 8) else 0


def serial_frame(came: bytes) -> int:
    """The request of Modbus on a serial line, as long as its function has it."""
    several = len(came) > 6 and came[1] in (15, 16)
    whole = 9 + came[6] if several else 7 if came[1:2] == b"\x2b" else 8
    return whole if len(came) >= whole else 0


class ForeignLine:
    """Gives whatever `answer` makes of a request; None closes the connection. Requests that come together are two.

    `met` is called when somebody connects.

    Attributes:
        port: where it listens.
        heard: what came, with the time at which it came.
    """

    def __init__(
        self, answer: Callable[[bytes], bytes | None], whole: WholeRequest = tcp_frame,
        met: Callable[[], None] = lambda: None,
    ) -> None:  # fmt: skip
        self.answer, self._whole, self._met = answer, whole, met
        self.heard: list[tuple[float, bytes]] = []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        self.clients: list[socket.socket] = []
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def lose(self) -> None:
        """From now on the kernel throws away every packet that comes here, as a network does that is out."""
        lost_packets.lose([self._listener, *self.clients])

    def heal(self) -> None:
        """Packets come through again: also those that the other side sends once more."""
        lost_packets.heal([self._listener, *self.clients])

    def reset(self) -> None:
        """Every connection is reset, as by a device that restarts."""
        for client in self.clients:
            with suppress(OSError):
                client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                client.shutdown(socket.SHUT_RD)
            client.close()

    def close(self) -> None:
        """Listen no more, and close every connection."""
        self._listener.close()
        for client in self.clients:
            client.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _serve(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.clients.append(client)
            self._met()
            threading.Thread(target=self._talk, args=(client,), daemon=True).start()

    def _talk(self, client: socket.socket) -> None:
        try:
            waiting = b""
            while came := client.recv(4096):
                waiting += came
                while count := self._whole(waiting):
                    request, waiting = waiting[:count], waiting[count:]
                    self.heard.append((time.monotonic(), request))
                    answer = self.answer(request)
                    if answer is None:
                        return
                    client.sendall(answer)
        except OSError:
            pass
        finally:
            client.close()


class BrokenPort:
    """A port of which every use raises."""

    def __init__(self, error: Exception) -> None:
        self._error = error
        self.quiet_until_s, self.line = 0.0, nullcontext()

    def __getattr__(self, name: str) -> object:
        raise self._error


def crc(data: bytes) -> bytes:
    """The checksum of a Modbus frame on a serial line, low byte first."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ 0xA001 if value & 1 else value >> 1
    return struct.pack("<H", value)


class Tables:
    """Registers of a Modbus device: holding and input ones by address, and what it says of itself."""

    def __init__(
        self, holding: Mapping[int, int] | None = None, inputs: Mapping[int, int] | None = None, identity: str = ""
    ) -> None:
        self.holding, self.inputs, self.identity = dict(holding or {}), dict(inputs or {}), identity

    def answered(self, request: bytes) -> bytes:
        """The answer to function and data, exception 1 or 2 where it has nothing."""
        function = request[0]
        try:
            if function in (3, 4):
                address, count = struct.unpack(">HH", request[1:5])
                table = self.holding if function == 3 else self.inputs
                words = [table[address + i] for i in range(count)]
                return struct.pack(f">BB{count}H", function, 2 * count, *words)
            if function == 6:
                address, word = struct.unpack(">HH", request[1:5])
                self.holding[address] = word
                return request[:5]
            if function == 16:
                address, count = struct.unpack(">HH", request[1:5])
                self.holding.update(enumerate(struct.unpack(f">{count}H", request[6 : 6 + 2 * count]), address))
                return request[:5]
            if function == 43 and self.identity:
                name = self.identity.encode()
                return bytes([43, 14, 1, 1, 0, 0, 1, 0, len(name)]) + name
        except KeyError:
            return bytes([function | 0x80, 2])
        return bytes([function | 0x80, 1])

    def on_tcp(self, frame: bytes) -> bytes:
        """The answer to a frame of Modbus TCP."""
        answer = self.answered(frame[7:])
        return frame[:4] + struct.pack(">HB", len(answer) + 1, frame[6]) + answer

    def on_serial(self, frame: bytes) -> bytes:
        """The answer to a frame on a serial line; nothing to one that is spoiled."""
        if frame[-2:] != crc(frame[:-2]):
            return b""
        answer = frame[:1] + self.answered(frame[1:-2])
        return answer + crc(answer)
