"""A CAN bus of a world, and a valve on it that speaks J1939 as ISO 11783-7 has it."""

from __future__ import annotations

import errno
import math
from abc import abstractmethod
from collections import deque
from collections.abc import Callable
from typing import Any

from tests.worlds.devices import Device
from tests.worlds.tasks import Hub, Waiters

DELAY_S = (2e-4, 1e-3)
_EVERY_S, _PATIENCE_S = 0.1, 0.3
_COMMAND, _ESTIMATED, _CLAIMED, _REQUEST = 0xFE31, 0xFE11, 0xEE00, 0xEA00
_OURS, _NAME, _ERROR = 0x80, 2 << 60 | 129 << 40 | 1, 14
_PER_BIT = 0.4
_LAST_STANDARD = 0x7FF  # identifier of 11 bits
_MOST_WAITING = 10  # frames: the length of Linux's queue of a CAN controller
_CONTENDED_S = 0.25  # so long after a claim another one may come (SAE J1939-81, 4.5.2)


class CanBus:
    """Frames to everybody on it.

    Attributes:
        is_out: no frame arrives.
        is_off: the controller of this computer is off the bus: nothing is taken from it.
        is_passive: nobody acknowledges a frame: what this computer sends waits in its controller, so many at most,
            whoever sent it; what others send is lost.
        loses, doubles: chance of each frame.
        delay_s: least and greatest time of a frame.
        rushed_s: when somebody commanded who had just claimed his address, and not heard yet whose it is.
    """

    def __init__(self, hub: Hub, hear: Callable[[int, bytes], None]) -> None:
        self._hub, self._hear = hub, hear
        self.is_out = self.is_off = self._is_passive = False
        self._waiting: list[tuple[int, bytes, BusEnd]] = []
        self.loses = self.doubles = 0.0
        self.delay_s = DELAY_S
        self.ends: list[BusEnd] = []
        self.rushed_s: list[float] = []
        self._last_s = 0.0

    @property
    def is_passive(self) -> bool:
        return self._is_passive

    @is_passive.setter
    def is_passive(self, is_passive: bool) -> None:
        self._is_passive = is_passive
        waiting, self._waiting = self._waiting, []
        for frame in waiting:
            self.send(*frame)

    def send(self, identifier: int, data: bytes, by: BusEnd | None) -> None:
        """A frame, of an end or of a device."""
        draw = self._hub.draw
        if self.is_passive:
            if by is not None and len(self._waiting) >= _MOST_WAITING:
                raise OSError(errno.ENOBUFS, "No buffer space available")
            self._waiting += [] if by is None else [(identifier, data, by)]
            return
        for _ in range(2 if draw.random() < self.doubles else 1):
            if self.is_out or draw.random() < self.loses:
                continue
            self._last_s = max(self._last_s, self._hub.now_s + draw.uniform(*self.delay_s))
            self._hub.at(self._last_s, lambda: self._arrive(identifier, data, by))

    def _arrive(self, identifier: int, data: bytes, by: BusEnd | None) -> None:
        if by is not None:
            self._hear(identifier, data)
        for end in self.ends:
            if end is not by and not self.is_off:
                end.arrived(identifier, data)


class BusEnd:
    """As a bus of python-can, as far as `drivers._can` uses one."""

    end = None

    def __init__(self, hub: Hub, bus: CanBus, process: Any, call: Callable[[], None]) -> None:
        self._hub, self._bus, self._process, self._call = hub, bus, process, call
        self._received: deque[tuple[int, bytes]] = deque()
        self._changed = Waiters(hub)
        self._claimed_s = -math.inf
        self.holders = 1
        bus.ends.append(self)
        process.connected_s.append(hub.now_s)
        process.sockets.append(self)

    def send(self, message: Any) -> None:
        self._call()
        self._check()
        if self._bus.is_off:
            raise OSError(errno.ENOBUFS, "No buffer space available")
        group, now_s = message.arbitration_id >> 8 & 0x3FFFF, self._hub.now_s
        if group & 0x3FF00 == _CLAIMED:
            self._claimed_s = now_s
        elif group == _COMMAND and now_s < self._claimed_s + _CONTENDED_S:
            self._bus.rushed_s.append(now_s)
        self._bus.send(message.arbitration_id, bytes(message.data), self)

    def recv(self, wait_s: float) -> Any:
        import can

        self._call()
        self._check()
        until_s = self._hub.now_s + wait_s
        while not self._received:
            if self._hub.now_s >= until_s:
                return None
            self._changed.wait(until_s)
            self._call()
        identifier, data = self._received.popleft()
        return can.Message(arbitration_id=identifier, data=data, is_extended_id=identifier > _LAST_STANDARD)

    def arrived(self, identifier: int, data: bytes) -> None:
        """Of the bus."""
        self._received.append((identifier, data))
        self._changed.wake()

    def shutdown(self) -> None:
        self._call()
        self.close_by_system()

    def close_by_system(self) -> None:
        if self in self._bus.ends:
            self._bus.ends.remove(self)
            self._process.sockets.remove(self)

    def _check(self) -> None:
        if self not in self._bus.ends:
            raise OSError(errno.EBADF, "Bad file descriptor")


class OnABus(Device):
    """A device on a bus of its own.

    Attributes:
        mute: tells nothing of itself, and does what it is told.
    """

    def __init__(self, hub: Hub) -> None:
        super().__init__(hub)
        self.line = CanBus(hub, self._hear)

    @abstractmethod
    def put(self, percent: float) -> None:
        """Somebody else moves it."""

    @abstractmethod
    def take(self, identifier: int, data: bytes) -> None:
        """What it does with a frame."""

    def begin(self) -> None:
        """It has power again."""

    def restart(self, away_s: float) -> None:
        """Off for a while, its output at zero."""
        self.is_on = False
        self.put(0.0)
        self._hub.after(away_s, self._on_again)

    def _on_again(self) -> None:
        self.is_on = True
        self.begin()

    def _hear(self, identifier: int, data: bytes) -> None:
        if not self.deaf and self.is_on:
            self.take(identifier, data)

    def _say(self, identifier: int, data: bytes) -> None:
        if not self.mute and self.is_on:
            self.line.send(identifier, data, None)


class Valve(OnABus):
    """Obeys its command, tells the flow each 100 ms, and blocks when it hears no command for 0.3 s."""

    def __init__(self, hub: Hub) -> None:
        super().__init__(hub)
        self._hub.after(0.0, self._tick)

    def put(self, percent: float) -> None:
        self.stands(percent)

    def expire(self) -> None:
        self.stands(0.0)

    def fail(self, fails: bool) -> None:
        """A fault comes, or goes."""
        self.fails = fails
        self.stands(0.0)

    def take_address(self) -> None:
        """Another controller, whose NAME goes before every other one, claims the address of the bench."""
        self.line.send(0x18EEFF00 | 0x26, (1).to_bytes(8, "little"), None)

    def begin(self) -> None:
        self._say(0x18EEFF00 | _OURS, _NAME.to_bytes(8, "little"))

    def _tick(self) -> None:
        self._tell()
        self._hub.after(_EVERY_S, self._tick)

    def _tell(self) -> None:
        state = _ERROR if self.fails else 1 if self.percent > 0.0 else 2 if self.percent < 0.0 else 0
        flow = round(self.tells(round(self.percent))) + 125
        told = bytes([flow, 250 - flow, 0b0011_0000 | state, 0b0001_1111, *[0xFF] * 4])
        self._say(3 << 26 | _ESTIMATED << 8 | _OURS, told)

    def take(self, identifier: int, data: bytes) -> None:
        group, to = identifier >> 8 & 0x3FFFF, identifier >> 8 & 0xFF
        if group & 0x3FF00 == _REQUEST and to in (_OURS, 0xFF) and data[:3] == _CLAIMED.to_bytes(3, "little"):
            self._hub.at(self.soon(1e-4, 2e-3), self.begin)
        if group == _COMMAND and len(data) == 8 and data[0] <= 0xFA:
            self._hub.at(self.soon(1e-4, 2e-3), lambda: self._obey(data))

    def _obey(self, data: bytes) -> None:
        if not self.is_on:
            return
        self.heard(_PATIENCE_S)
        if not self.lies and not self.fails:
            self.stands(_PER_BIT * data[0] * {1: 1.0, 2: -1.0}.get(data[2] & 0x0F, 0.0))
        self._tell()
