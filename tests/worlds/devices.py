"""Devices of a world: they share no code with drivers or twins, and remember where their output stood."""

from __future__ import annotations

import struct
from collections.abc import Callable
from weakref import WeakKeyDictionary, WeakSet

from tests.foreign_line import Tables, tcp_frame
from tests.worlds.network import Cable, End, Host
from tests.worlds.tasks import Hub

FULL, READ_BACK = 0x7FFF, 0x0200
_TRIGGER, _TENTHS = 0x100A, 0x1000
_IDENTITY = 43  # function
_REMAINS = 60  # counts: a valve that was driven does not come back quite to where it was, and that is no fault
PATIENCE_S = 0.1  # so soon an answer comes to whoever sends on


class Device:
    """Holds an output.

    Attributes:
        changes: (s, % of full scale) of the output, each time that it was another one.
        deaf: takes nothing in; mute: obeys and does not answer; lies: acknowledges and does not obey.
        fails: reports a fault, and its output falls to zero.
        slow_s: so much longer it takes to answer.
        is_on: whether it has power.
        watchers: called when the output moves.
        expired_s: when its own watchdog found the output away from its safe value.
        unwatched_s: when something was said to it while that was not armed.
        told: each reading that it has told: (s, in the unit of its channel).
    """

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self.told: list[tuple[float, float]] = []
        self.changes: list[tuple[float, float]] = [(0.0, 0.0)]
        self.deaf = self.mute = self.lies = self.fails = False
        self.is_on, self.slow_s = True, 0.0
        self.watchers: list[Callable[[], None]] = []
        self.expired_s: list[float] = []
        self.unwatched_s: list[float] = []
        self._free_s, self._heard_s = 0.0, 0.0

    @property
    def percent(self) -> float:
        """Where the output stands."""
        return self.changes[-1][1]

    def stands(self, percent: float) -> None:
        """It stands there from now on."""
        if percent != self.percent:
            self.changes.append((self._hub.now_s, percent))
            for watch in self.watchers:
                watch()

    def tells(self, value: float) -> float:
        """This reading goes out."""
        self.told.append((self._hub.now_s, value))
        return value

    def soon(self, least_s: float, most_s: float) -> float:
        """When it is through with the next request: one after the other."""
        self._free_s = max(self._free_s, self._hub.now_s) + self._hub.draw.uniform(least_s, most_s) + self.slow_s
        return self._free_s

    def heard(self, watchdog_s: float) -> None:
        """Somebody spoke to it: its own watchdog begins anew, where it has one (0: none)."""
        self._heard_s = self._hub.now_s
        if watchdog_s:
            self._hub.after(watchdog_s, lambda: self._expired(watchdog_s))
        else:
            self.unwatched_s.append(self._hub.now_s)

    def _expired(self, watchdog_s: float) -> None:
        if self.is_on and self._hub.now_s - self._heard_s >= watchdog_s - 1e-9:
            self.expired_s += [self._hub.now_s] if self.percent else []
            self.expire()

    def expire(self) -> None:
        """Nothing was said to it for longer than its watchdog allows."""


class Coupler(Device, Tables):
    """A coupler on Modbus TCP: an output, read back from 0x0200, and inputs that follow it.

    Attributes:
        pressure: second input, in counts.
        contact: third input, of an emergency stop: about zero when somebody has pressed.
        stuck: where the valve stands that sticks, in counts: the output obeys, and the flow does not.
        measured: each answer about inputs: (s, count that the output was told last, count of the first input).
        written: when something was written to it.
        asked_s: when a request for its inputs has come; commanded_s: when one to move its output has.
        read_back: each answer about where its output stands: (s, count).
        reused: when a connection was used again on which no answer had come in time.
        inputs_told: each answer about inputs: (s, counts).
        unasked: when a new connection began with a command other than the safe one.
        unmet_s: when it was driven away on a connection on which nobody had asked what it is.
    """

    def __init__(self, hub: Hub, cable: Cable, identity: str, pressure: int = 0) -> None:
        registers = [*range(4), *range(READ_BACK, READ_BACK + 4), _TENTHS, 0x1008, _TRIGGER]
        Device.__init__(self, hub)
        Tables.__init__(self, holding=dict.fromkeys(registers, 0), identity=identity)
        self.pressure = pressure
        self.host = Host(hub, cable, self.taken)
        self.contact = FULL // 2  # of an emergency stop: closed
        self.stuck: int | None = None
        self.measured: list[tuple[float, int, int]] = []
        self.inputs_told: list[tuple[float, tuple[int, ...]]] = []
        self.unmet_s: list[float] = []
        self._met: WeakSet[End] = WeakSet()  # connections on which it has said what it is
        self.written: list[float] = []
        self.asked_s: list[float] = []
        self.commanded_s: list[float] = []
        self.read_back: list[tuple[float, int]] = []
        self.unasked: list[float] = []
        self.reused: list[float] = []
        self._silent_s: WeakKeyDictionary[End, float] = WeakKeyDictionary()  # since when no answer comes
        self._told = 0
        self._asked: WeakSet[End] = WeakSet()  # connections on which it was read back, or made safe

    def put(self, percent: float) -> None:
        """Somebody else moves it, or it does so by itself."""
        count = round(percent / 100.0 * FULL) & 0xFFFF
        self.holding[0] = self.holding[READ_BACK] = count
        self._moved()

    def restart(self, away_s: float) -> None:
        """Off for a while: its output falls to zero, and it knows nothing of any connection."""
        self.host.is_on = False
        for end in self.host.ends:
            end.gone(None)
        self.holding[_TRIGGER] = 0
        self.put(0.0)
        self._hub.after(away_s, lambda: setattr(self.host, "is_on", True))

    def hang_up(self) -> None:
        """It resets every connection."""
        for end in self.host.ends:
            end.reset()

    def taken(self, end: End) -> None:
        """Somebody has connected."""
        end.on_data = self._heard

    def _heard(self, end: End) -> None:
        if end.is_gone or self.deaf:
            return
        if end.has_ended and not end.received:
            end.close()
            return
        waiting = bytes(end.received)
        while count := tcp_frame(waiting):
            request, waiting = waiting[:count], waiting[count:]
            if request[7] == 4:
                self.asked_s.append(self._hub.now_s)
            elif _is_command(request[7:]):
                self.commanded_s.append(self._hub.now_s)
            at_s = self.soon(1e-4, 6e-4)
            self._hub.at(at_s, lambda request=request: self._answer(end, request))  # type: ignore[misc]
        end.received[:] = waiting

    def _answer(self, end: End, request: bytes) -> None:
        if self.deaf or not self.host.is_on:
            return
        self._look_at(end, request[7:])
        if self._hub.now_s > self._silent_s.get(end, float("inf")) + PATIENCE_S:
            self.reused.append(self._hub.now_s)
        if self.mute:
            self._silent_s.setdefault(end, self._hub.now_s)
        answer = self.on_tcp(request)
        if not self.mute and not end.is_gone and not end.is_over:
            end.send(answer)

    def _look_at(self, end: End, request: bytes) -> None:
        """The first command on a connection is the safe value, unless it was asked before where the output stands."""
        is_command = _is_command(request)
        count = int.from_bytes(request[-2:] if request[0] == 6 else request[6:8], "big", signed=True)
        if is_command:
            self._told = count
        if is_command and count and end not in self._asked:
            self.unasked.append(self._hub.now_s)
        if is_command and count and end not in self._met:
            self.unmet_s.append(self._hub.now_s)
        if request[0] == _IDENTITY:
            self._met.add(end)
        if is_command or _is_read_back(request):
            self._asked.add(end)

    def answered(self, request: bytes) -> bytes:
        self.heard(0.1 * self.holding[_TENTHS] if self.holding[_TRIGGER] else 0.0)
        self.inputs = self._measured()
        if request[0] in (5, 6, 15, 16):
            self.written.append(self._hub.now_s)
        if request[0] == 4:
            self.measured.append((self._hub.now_s, self._told, _signed(self.inputs[0])))
            self.inputs_told.append((self._hub.now_s, tuple(map(_signed, self.inputs.values()))))
        if _is_read_back(request):
            self.read_back.append((self._hub.now_s, _signed(self.holding[READ_BACK])))
        before = dict(self.holding)
        answer = super().answered(request)
        if self.lies and request[0] in (6, 16):
            self.holding = before
        self.holding.update((READ_BACK + i, self.holding[i]) for i in range(4))
        self._moved()
        return answer

    def _measured(self) -> dict[int, int]:
        noise = self._hub.draw.randrange(-3, 4)
        spool = self.holding[0] if self.stuck is None else self.stuck
        remains = _REMAINS * (len(self.changes) > 1)
        counts = [_signed(spool) + noise + remains, self.pressure + noise, self.contact + noise, *[noise] * 5]
        return {i: max(-FULL, min(FULL, count)) & 0xFFFF for i, count in enumerate(counts)}

    def expire(self) -> None:
        if self.holding[_TRIGGER]:
            self.put(0.0)
            self._asked.clear()

    def _moved(self) -> None:
        self.stands(100.0 * _signed(self.holding[0]) / FULL)


def _is_command(request: bytes) -> bool:
    return request[0] in (6, 16) and request[1:3] == b"\0\0"


def _is_read_back(request: bytes) -> bool:
    return request[0] == 3 and request[1:3] == READ_BACK.to_bytes(2, "big")


def _signed(word: int) -> int:
    return int(struct.unpack(">h", struct.pack(">H", word))[0])
