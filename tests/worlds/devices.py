"""A coupler on Modbus TCP in a world: it shares no code with drivers or twins, and remembers where its output stood."""

from __future__ import annotations

import struct
from collections.abc import Callable

from tests.foreign_line import Tables, tcp_frame
from tests.worlds.network import Cable, End, Host
from tests.worlds.tasks import Hub

FULL, READ_BACK = 0x7FFF, 0x0200
_TRIGGER, _TENTHS = 0x100A, 0x1000


class Coupler(Tables):
    """An output, read back from 0x0200, and inputs that follow it.

    Attributes:
        changes: (s, % of full scale) of the output, each time that it was another one.
        deaf: takes nothing in; mute: obeys and does not answer; lies: acknowledges and does not obey.
        slow_s: so much longer it takes to answer.
        pressure: second input, in counts.
        contact: third input, of an emergency stop: about zero when somebody has pressed.
        read: every count of the first input that it measured.
    """

    def __init__(self, hub: Hub, cable: Cable, identity: str, pressure: int = 0) -> None:
        registers = [*range(4), *range(READ_BACK, READ_BACK + 4), _TENTHS, 0x1008, _TRIGGER]
        super().__init__(holding=dict.fromkeys(registers, 0), identity=identity)
        self._hub, self.pressure = hub, pressure
        self.host = Host(hub, cable, self.taken)
        self.changes: list[tuple[float, float]] = [(0.0, 0.0)]
        self.deaf = self.mute = self.lies = False
        self.contact = FULL // 2  # of an emergency stop: closed
        self.slow_s = 0.0
        self._came: dict[int, bytes] = {}
        self._free_s, self._heard_s = 0.0, 0.0
        self.watchers: list[Callable[[], None]] = []
        self.read: set[int] = set()

    @property
    def percent(self) -> float:
        """Where the output stands."""
        return self.changes[-1][1]

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
            self._free_s = max(self._free_s, self._hub.now_s) + self._hub.draw.uniform(1e-4, 6e-4) + self.slow_s
            self._hub.at(self._free_s, lambda request=request: self._answer(end, request))  # type: ignore[misc]
        end.received[:] = waiting

    def _answer(self, end: End, request: bytes) -> None:
        if self.deaf or not self.host.is_on:
            return
        answer = self.on_tcp(request)
        if not self.mute and not end.is_gone and not end.is_over:
            end.send(answer)

    def answered(self, request: bytes) -> bytes:
        self._heard_s = self._hub.now_s
        if self.holding[_TRIGGER] and self.holding[_TENTHS]:
            self._hub.after(0.1 * self.holding[_TENTHS], self._expire)
        self.inputs = self._measured()
        before = dict(self.holding)
        answer = super().answered(request)
        if self.lies and request[0] in (6, 16):
            self.holding = before
        self.holding.update((READ_BACK + i, self.holding[i]) for i in range(4))
        self._moved()
        return answer

    def _measured(self) -> dict[int, int]:
        at, noise = self.holding[0], self._hub.draw.randrange(-3, 4)
        signed = at - 0x10000 if at > 0x7FFF else at
        counts = [signed + noise, self.pressure + noise, self.contact + noise, *[noise] * 5]
        self.read.add(max(-FULL, min(FULL, counts[0])))
        return {i: max(-FULL, min(FULL, count)) & 0xFFFF for i, count in enumerate(counts)}

    def _expire(self) -> None:
        """Its own watchdog: nothing was asked for longer than its time."""
        armed_s = 0.1 * self.holding[_TENTHS]
        if self.holding[_TRIGGER] and armed_s and self._hub.now_s - self._heard_s >= armed_s - 1e-9:
            self.put(0.0)

    def _moved(self) -> None:
        at = 100.0 * struct.unpack(">h", struct.pack(">H", self.holding[0]))[0] / FULL
        if at != self.percent:
            self.changes.append((self._hub.now_s, at))
            for watch in self.watchers:
                watch()
