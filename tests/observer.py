"""What stands at a device, looked at from outside: own frames on own connections, nothing of the program.

It shares no code with what it judges: raw bytes of Modbus TCP and RTU, of ASCII modules and of a CAN bus over
socketcand, and a line that can fall dead between the program and the device.
"""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections.abc import Callable
from contextlib import suppress

from tests.foreign_line import crc

FULL = 0x7FFF  # of a WAGO output: 10 V, 100 %
_AO0_READ_BACK = 0x0200
_ANSWER_S = 0.5


class Line:
    """A TCP connection to a device that can fall dead: it stays open, and nothing gets through any more.

    Attributes:
        asked: every piece that went to the device.
        taken: connections so far.
    """

    def __init__(self, device_port: int) -> None:
        self._device_port = device_port
        self.dead, self.taken = False, 0
        self.asked: list[bytes] = []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        self._open: list[socket.socket] = []
        self._ended = False
        threading.Thread(target=self._accept, daemon=True).start()

    def hang_up(self) -> None:
        """Close every connection that there is, in order, as a device does it."""
        held, self._open = self._open, []
        for end in held:
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """End it."""
        self._ended = True
        with suppress(OSError):  # closing alone would leave the thread that waits there, and its port open
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for end in self._open:
            with suppress(OSError):
                end.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                self._open.append(near)
                if self._ended:
                    near.close()
                    return
                try:
                    far = socket.create_connection(("127.0.0.1", self._device_port))
                except OSError:  # the device has gone
                    near.close()
                    continue
                self._open.append(far)
                self.taken += 1
                if self._ended:
                    near.close()
                    far.close()
                    return
                for end in (near, far):
                    with suppress(OSError):  # one that has gone already is noticed by who carries
                        end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                for one, other, kept in ((near, far, self.asked), (far, near, [])):
                    threading.Thread(target=self._carry, args=(one, other, kept), daemon=True).start()

    def _carry(self, one: socket.socket, other: socket.socket, kept: list[bytes]) -> None:
        with suppress(OSError):
            while data := one.recv(4096):
                if not self.dead:
                    kept.append(data)
                    other.sendall(data)
        for end in (one, other):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()


class _Asking:
    """A connection on which one question is asked at a time; opened again after a failure."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._socket: socket.socket | None = None

    def __del__(self) -> None:
        if self._socket is not None:
            self._socket.close()

    def ask(self, question: bytes, is_whole: Callable[[bytes], bool]) -> bytes:
        """The answer; raises `OSError` when there is none in time."""
        try:
            if self._socket is None:
                self._socket = socket.create_connection(("127.0.0.1", self._port), _ANSWER_S)
                self._socket.settimeout(_ANSWER_S)
            self._socket.sendall(question)
            answer = b""
            while not is_whole(answer):
                more = self._socket.recv(256)
                if not more:
                    raise ConnectionError("closed")
                answer += more
            return answer
        except OSError:
            if self._socket is not None:
                self._socket.close()
            self._socket = None
            raise


def modbus_tcp(port: int) -> Callable[[], float]:
    """The first output of a WAGO coupler, in %, read back from its registers."""
    line = _Asking(port)
    question = struct.pack(">HHHBBHH", 7, 0, 6, 1, 3, _AO0_READ_BACK, 1)
    return lambda: 100.0 * struct.unpack(">h", line.ask(question, lambda a: len(a) >= 11)[9:11])[0] / FULL


def modbus_rtu(port: int) -> Callable[[], float]:
    """The same through a serial server."""
    line = _Asking(port)
    question = struct.pack(">BBHH", 1, 3, _AO0_READ_BACK, 1)

    def look() -> float:
        answer = line.ask(question + crc(question), lambda a: len(a) >= 7)
        if crc(answer[:5]) != answer[5:7]:
            raise OSError(f"garbled: {answer.hex()}")
        return float(100.0 * struct.unpack(">h", answer[3:5])[0] / FULL)

    return look


def ascii_module(port: int) -> Callable[[], float]:
    """The first output of module 01, in % of 10 V: what it was told last."""
    line = _Asking(port)
    return lambda: 10.0 * float(line.ask(b"$016C0\r", lambda a: a.endswith(b"\r"))[3:])


class _Bus:
    """A member of a CAN bus that listens, and asks with SYNC only when nobody else does."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port))
        for word in (b"< open can0 >", b"< rawmode >"):
            self._socket.recv(64)
            self._socket.sendall(word)
        self._told: tuple[float, bytes] = (0.0, b"")
        threading.Thread(target=self._hear, daemon=True).start()

    def look(self) -> float:
        """The actual value of node 1, in %, from its first process data object."""
        until_s = time.monotonic() + _ANSWER_S
        while time.monotonic() - self._told[0] > 0.05:
            if time.monotonic() > until_s:
                raise OSError("no process data")
            self._socket.sendall(b"< send 80 0 >")
            time.sleep(0.01)
        return 100.0 * struct.unpack("<h", self._told[1][2:4])[0] / 16384

    def _hear(self) -> None:
        received = b""
        with self._socket, suppress(OSError):
            while more := self._socket.recv(4096):
                *frames, received = (received + more).split(b">")
                for frame in frames:
                    words = frame.decode("ascii", "replace").strip(" <").split()
                    if words[:2] == ["frame", "181"] and len(words) > 3:
                        self._told = time.monotonic(), bytes.fromhex(words[3])


def canopen(port: int) -> Callable[[], float]:
    """The spool of a valve on CANopen, in %."""
    return _Bus(port).look


class Watch:
    """Looks again and again, and remembers when the output was not safe last.

    Attributes:
        now: what stood there when somebody looked last, %; None before anybody could.
        unsafe_s: when it was away from zero last, on the monotonic clock.
    """

    def __init__(self, look: Callable[[], float], tolerance: float, every_s: float = 0.01) -> None:
        self._look, self._tolerance, self._every_s = look, tolerance, every_s
        self.now: float | None = None
        self.unsafe_s = 0.0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def is_safe(self) -> bool:
        """Whether it stood at zero when somebody looked last."""
        return self.now is not None and abs(self.now) <= self._tolerance

    def wait(self, until: Callable[[], bool], within_s: float) -> bool:
        """Whether something became true in time."""
        deadline_s = time.monotonic() + within_s
        while not until():
            if time.monotonic() > deadline_s:
                return False
            time.sleep(0.005)
        return True

    def close(self) -> None:
        """Look no more."""
        self._ended.set()
        self._thread.join(2.0)

    def _run(self) -> None:
        while not self._ended.wait(self._every_s):
            with suppress(OSError, ValueError, struct.error):
                self.now = self._look()
                if not self.is_safe:
                    self.unsafe_s = time.monotonic()
