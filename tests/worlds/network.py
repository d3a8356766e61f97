"""TCP as the kernel of this computer and those of the devices do it, over cables that lose, hold and delay.

What matters for outputs is in it: what was sent and not acknowledged goes out again, behind the back of a program that
closed its socket; `SO_LINGER` {1, 0}, `TCP_USER_TIMEOUT` and forgetting a connection end that; a reset may be lost
itself, so that the other side still holds its end; who restarts knows nothing of old connections. What is left out
(windows, congestion, fragments) moves no byte before another one. `kernel.py` holds it against Linux.
"""

from __future__ import annotations

import errno
import socket
import struct
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

from tests.worlds.tasks import Hub, Waiters

_AGAIN_S, _LONGEST_AGAIN_S = 0.2, 16.0  # of retransmission
_GIVES_UP_S = 60.0  # an end without a time-out of its own
_SYN_AGAIN_S = 1.0


class Cable:
    """Between this computer and one device.

    Attributes:
        is_out: nothing passes.
        delay_s: least and greatest time that a segment takes.
        holds_s: a hub on the way holds back a segment for so long, now and then.
        holds_chance: how often; doubles, loses: chance of each segment.
    """

    def __init__(self, hub: Hub, delay_s: tuple[float, float]) -> None:
        self._hub, self.delay_s = hub, delay_s
        self.is_out = False
        self.holds_s, self.holds_chance = 0.0, 0.0
        self.doubles = self.loses = 0.0

    def passes(self, arrive: Callable[[], None], not_before_s: float = 0.0) -> float:
        """Send one segment; returns when it arrives, 0 where it is lost."""
        draw = self._hub.draw
        if self.is_out or (self.loses and draw.random() < self.loses):
            return 0.0
        takes_s = draw.uniform(*self.delay_s)
        if self.holds_chance and draw.random() < self.holds_chance:
            takes_s += draw.uniform(0.0, self.holds_s)
        at_s = max(self._hub.now_s + takes_s, not_before_s)
        self._hub.at(at_s, arrive)
        if self.doubles and draw.random() < self.doubles:
            self._hub.at(at_s + draw.uniform(*self.delay_s), arrive)
        return at_s


class End:
    """One end of a connection.

    Attributes:
        received: bytes that have come in order.
        has_ended: the other side sends no more.
        error: why it is gone, as the next call says it.
        linger: (1, 0): closing resets it. user_timeout_s: what is not acknowledged for so long ends it.
    """

    def __init__(self, hub: Hub, cable: Cable) -> None:
        self._hub, self._cable = hub, cable
        self.other: End | None = None
        self.received = bytearray()
        self.has_ended = self.is_gone = self.is_over = False
        self.error: OSError | None = None
        self.linger: tuple[int, int] = (0, 0)
        self.user_timeout_s = 0.0
        self.changed = Waiters(hub)
        self.on_data: Callable[[End], None] = lambda _end: None
        self._unacknowledged: deque[tuple[int, bytes, float]] = deque()
        self._sent = self._expected = self._arrives_s = 0  # type: ignore[assignment]
        self._early: dict[int, bytes] = {}
        self._again_s, self._asked_again = _AGAIN_S, False

    @property
    def unacknowledged(self) -> int:
        return sum(len(data) or 1 for _, data, _ in self._unacknowledged)

    def send(self, data: bytes) -> None:
        """Bytes, or the end of them (nothing)."""
        self._unacknowledged.append((self._sent, data, self._hub.now_s))
        self._sent += 1
        self._transmit(*self._unacknowledged[-1][:2])
        self._later()

    def _transmit(self, number: int, data: bytes) -> None:
        other = self.other
        assert other is not None
        at_s = self._cable.passes(lambda: other.arrived(number, data), self._arrives_s)
        self._arrives_s = max(self._arrives_s, at_s)

    def _later(self) -> None:
        if not self._asked_again and self._unacknowledged:
            self._asked_again = True
            self._hub.after(self._again_s, self._again)

    def _again(self) -> None:
        """Nothing was acknowledged: once more, or given up."""
        self._asked_again = False
        if self.is_gone or not self._unacknowledged:
            return
        waited_s = self._hub.now_s - self._unacknowledged[0][2]
        if waited_s >= (self.user_timeout_s or _GIVES_UP_S):
            self.gone(TimeoutError(errno.ETIMEDOUT, "Connection timed out"))
            return
        if waited_s >= 0.9 * self._again_s:
            for number, data, _ in list(self._unacknowledged):
                self._transmit(number, data)
            self._again_s = min(2.0 * self._again_s, _LONGEST_AGAIN_S)
        self._later()

    def arrived(self, number: int, data: bytes) -> None:
        """A segment of the other side."""
        other = self.other
        assert other is not None
        if self.is_gone:
            if not other.is_gone:
                self._cable.passes(
                    lambda: other.gone(ConnectionResetError(errno.ECONNRESET, "Connection reset by peer"))
                )
            return
        if self.is_over and data:  # closed whole: nobody takes it any more
            self.reset()
            return
        if number >= self._expected:
            self._early[number] = data
        while self._expected in self._early:
            came = self._early.pop(self._expected)
            self._expected += 1
            self.received += came
            self.has_ended = self.has_ended or not came
        upto, misses = self._expected, bool(self._early)
        self._cable.passes(lambda: other.acknowledged(upto, misses))
        self.changed.wake()
        self.on_data(self)

    def acknowledged(self, upto: int, misses: bool) -> None:
        """Everything before a segment has come; `misses`: something behind it too, so it goes out again at once."""
        before = len(self._unacknowledged)
        while self._unacknowledged and self._unacknowledged[0][0] < upto:
            self._unacknowledged.popleft()
        if len(self._unacknowledged) < before:
            self._again_s = _AGAIN_S
            self.changed.wake()
        if misses and self._unacknowledged and self._unacknowledged[0][0] == upto:
            self._transmit(*self._unacknowledged[0][:2])

    def gone(self, error: OSError | None) -> None:
        """It is no more: nothing is sent on it again."""
        if not self.is_gone:
            self.is_gone, self.error = True, error
            self._unacknowledged.clear()
            self.changed.wake()
            self.on_data(self)

    def reset(self) -> None:
        """Throw everything away, and say so to the other side behind what is on its way; it may not hear it."""
        other = self.other
        assert other is not None
        if not self.is_gone:
            self.gone(OSError(errno.EBADF, "Bad file descriptor"))
            if not other.is_gone:
                error = ConnectionResetError(errno.ECONNRESET, "Connection reset by peer")
                self._cable.passes(lambda: other.gone(error), self._arrives_s)

    def close(self) -> None:
        """As the last `close` of a socket does it."""
        if self.is_gone or self.is_over:
            return
        self.is_over = True
        if self.linger == (1, 0) or self.received:
            self.reset()
        else:
            self.send(b"")  # and what is not acknowledged goes out again


class Host:
    """A device on the network: what listens there, and whether it is on.

    Attributes:
        taken: called with the end of a new connection.
        most: connections at a time; more are not answered.
        back: the way from it, where that is another one.
    """

    def __init__(self, hub: Hub, cable: Cable, taken: Callable[[End], None], back: Cable | None = None) -> None:
        self._hub, self.cable, self.taken, self.back = hub, cable, taken, back or cable
        self.is_on, self.most = True, 8
        self.ends: list[End] = []

    def asked(self, asking: Asking) -> None:
        """Somebody wants a connection: he hears of his end of it, where there is room."""
        self.ends = [end for end in self.ends if not end.is_gone and not end.has_ended]
        if not self.is_on or (asking.far is None and len(self.ends) >= self.most):
            return
        if asking.far is None:
            asking.near, asking.far = End(self._hub, self.cable), End(self._hub, self.back)
            asking.near.other, asking.far.other = asking.far, asking.near
            self.ends.append(asking.far)
            self.taken(asking.far)
        self.back.passes(asking.answered)


class Asking:
    """A connection that is asked for; who has given up resets it when the answer comes."""

    def __init__(self, hub: Hub) -> None:
        self.near: End | None = None
        self.far: End | None = None
        self.is_made = self.is_given_up = False
        self.waits = Waiters(hub)

    def answered(self) -> None:
        """The other side has it."""
        if self.is_given_up and self.near is not None:
            self.near.reset()
        self.is_made = True
        self.waits.wake()


class Socket:
    """A socket of a process of this computer, as far as `hil.system.tcp` uses one."""

    def __init__(self, hub: Hub, hosts: dict[tuple[str, int], Host], process: Any, call: Callable[[], None]) -> None:
        self._hub, self._hosts, self._process, self._call = hub, hosts, process, call
        self.end: End | None = None
        self._asking: Asking | None = None
        self._timeout_s: float | None = None
        self._linger, self._user_timeout_s = (0, 0), 0.0
        self._is_closed = False
        self.holders = 1
        process.sockets.append(self)

    def settimeout(self, timeout_s: float | None) -> None:
        self._timeout_s = timeout_s

    def fileno(self) -> int:
        return -1 if self._is_closed else 99

    def setsockopt(self, level: int, name: int, value: int | bytes) -> None:
        self._check()
        if (level, name) == (socket.SOL_SOCKET, socket.SO_LINGER):
            self._linger = struct.unpack("ii", value)  # type: ignore[assignment, arg-type]
        elif (level, name) == (socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT):
            self._user_timeout_s = int(value) / 1000.0  # type: ignore[arg-type]
        self._tell_end()

    def _tell_end(self) -> None:
        if self.end is not None:
            self.end.linger, self.end.user_timeout_s = self._linger, self._user_timeout_s

    def connect(self, place: tuple[str, int]) -> None:
        self._call()
        until_s = None if self._timeout_s is None else self._hub.now_s + self._timeout_s
        host = self._hosts.get((place[0], place[1]))
        asking, again_s = Asking(self._hub), _SYN_AGAIN_S
        self._asking = asking
        while True:
            if host is not None:
                host.cable.passes(partial(host.asked, asking))
            next_s = self._hub.now_s + again_s
            while not asking.is_made and self._hub.now_s < next_s:
                if until_s is not None and self._hub.now_s >= until_s:
                    raise TimeoutError("timed out")  # and it is closed
                asking.waits.wait(next_s if until_s is None else min(next_s, until_s))
                self._call()
            if asking.is_made:
                self._process.connected_s.append(self._hub.now_s)
                self.end, self._asking = asking.near, None
                self._tell_end()
                return
            again_s *= 2.0

    def sendall(self, data: bytes) -> None:
        self._call()
        self._raise_error()
        assert self.end is not None
        self.end.send(data)

    def recv(self, most: int, flags: int = 0) -> bytes:
        self._call()
        assert self.end is not None
        if not self.end.received:
            self._raise_error()
            return b""
        came = bytes(self.end.received[:most])
        if not flags & socket.MSG_PEEK:
            del self.end.received[:most]
        return came

    def is_readable(self, wait_s: float) -> bool:
        self._call()
        self._check()
        until_s = self._hub.now_s + wait_s
        assert self.end is not None
        while not (self.end.received or self.end.has_ended or self.end.is_gone):
            if self._hub.now_s >= until_s:
                return False
            self.end.changed.wait(until_s)
            self._call()
        return True

    def unacknowledged(self) -> int:
        return 0 if self._is_closed or self.end is None else self.end.unacknowledged

    def shutdown(self, _how: int) -> None:
        self._call()
        self._raise_error()
        if self.end is not None and not self.end.is_over:
            self.end.is_over = True
            self.end.send(b"")

    def forget(self) -> None:
        self._call()
        if self.end is not None:
            self.end.reset()

    def close(self) -> None:
        self._call()
        self.close_by_system()

    def close_by_system(self) -> None:
        if self._is_closed:
            return
        self._is_closed = True
        if self in self._process.sockets:
            self._process.sockets.remove(self)
        self.holders -= 1
        if self._asking is not None:
            self._asking.is_given_up = True
        if self.end is not None and self.holders <= 0:
            self.end.close()

    def _check(self) -> None:
        if self._is_closed:
            raise OSError(errno.EBADF, "Bad file descriptor")

    def _raise_error(self) -> None:
        self._check()
        if self.end is None:
            raise OSError(errno.ENOTCONN, "Transport endpoint is not connected")
        if self.end.is_gone:
            raise self.end.error or ConnectionResetError(errno.ECONNRESET, "Connection reset by peer")
