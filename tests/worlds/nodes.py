"""Devices on a CAN bus of a world beside a valve on J1939: a node of CANopen, and a driver by a DBC file."""

from __future__ import annotations

import struct

from tests.worlds.can_bus import OnABus
from tests.worlds.tasks import Hub

_NODE, _MISSED = 5, 0x8130
_OPERATIONAL, _PRE_OPERATIONAL = 0x01, 0x80
_COUNTS = 32767  # of 10 V, in CiA 401
_NO_SUCH_OBJECT = 0x06020000
_EVERY_S, _PATIENCE_S = 0.02, 0.3
_COMMAND, _STATE = 0x200, 0x201
Place = tuple[int, int]
_OBJECTS: dict[Place, tuple[str, int]] = {
    (0x1000, 0): ("<I", 0x000C0191), (0x1018, 1): ("<I", 0), (0x1016, 1): ("<I", 0),
    (0x1401, 1): ("<I", 0x300 + _NODE), (0x1401, 2): ("<B", 255), (0x1601, 0): ("<B", 4),
    (0x1801, 1): ("<I", 0x280 + _NODE), (0x1801, 2): ("<B", 255), (0x1A01, 0): ("<B", 4),
    **{(0x1601, sub): ("<I", 0x64110010 | sub << 8) for sub in range(1, 5)},
    **{(0x1A01, sub): ("<I", 0x64010010 | sub << 8) for sub in range(1, 5)},
    **{(index, sub): ("<h", 0) for index in (0x6401, 0x6411) for sub in range(1, 5)},
    **{(0x6443, sub): ("<B", 1) for sub in range(1, 5)},
}  # fmt: skip


class Node(OnABus):
    """An output module after CiA 401: it obeys while it is operational, and falls to 0 V when it misses its master."""

    def __init__(self, hub: Hub) -> None:
        super().__init__(hub)
        self._values, self._is_operational = {place: value for place, (_, value) in _OBJECTS.items()}, False

    def put(self, percent: float) -> None:
        self._values[0x6411, 1] = round(percent / 100.0 * _COUNTS)
        self.stands(percent)

    def expire(self) -> None:
        self._is_operational = False
        self.put(0.0)
        self._say(0x080 + _NODE, struct.pack("<HB5x", _MISSED, 0x11))

    def begin(self) -> None:
        self._values, self._is_operational = {place: value for place, (_, value) in _OBJECTS.items()}, False
        self._say(0x700 + _NODE, b"\x00")

    def take(self, identifier: int, data: bytes) -> None:
        watched = self._values[0x1016, 1]
        if identifier == 0x700 + (watched >> 16 or 127):
            self.heard((watched & 0xFFFF) / 1000.0)
        if identifier == 0x000 and data[1] in (0, _NODE):
            self._is_operational = data[0] == _OPERATIONAL
        elif identifier == 0x600 + _NODE:
            self._hub.at(self.soon(1e-4, 2e-3), lambda: self._on_sdo(data))
        elif self._is_operational and identifier == self._values[0x1401, 1]:
            self._hub.at(self.soon(1e-4, 2e-3), lambda: self._obey(data))
        elif self._is_operational and identifier == 0x080 and self._values[0x1801, 2] == 1:
            self._hub.at(self.soon(1e-4, 2e-3), self._measure)

    def _on_sdo(self, data: bytes) -> None:
        index, sub = struct.unpack("<HB", data[1:4])
        if data[0] == 0x80 or not self.is_on:
            return
        form, _ = _OBJECTS.get((index, sub), ("", 0))
        size = struct.calcsize(form)
        if not form:
            answer = struct.pack("<BHBI", 0x80, index, sub, _NO_SUCH_OBJECT)
        elif data[0] == 0x40:
            value = struct.pack(form, self._values[index, sub])
            answer = struct.pack("<BHB4s", 0x43 | 4 - size << 2, index, sub, value)
        else:
            (self._values[index, sub],) = struct.unpack(form, data[4 : 4 + size])
            answer = struct.pack("<BHB4x", 0x60, index, sub)
        self._say(0x580 + _NODE, answer)

    def _obey(self, data: bytes) -> None:
        if not self.is_on or not self._is_operational or self.lies:
            return
        if not self._values[0x1016, 1]:
            self.unwatched_s.append(self._hub.now_s)
        places = [(entry >> 16, entry >> 8 & 0xFF) for entry in self._mapped(0x1601)]
        self._values |= dict(zip(places, struct.unpack(f"<{len(places)}h", data[: 2 * len(places)]), strict=True))
        self.stands(100.0 * self._values[0x6411, 1] / _COUNTS)

    def _measure(self) -> None:
        noise = self._hub.draw.randrange(-3, 4)
        self._values[0x6401, 1] = max(-_COUNTS, min(_COUNTS, round(self.percent / 100.0 * _COUNTS) + noise))
        self.tells(10.0 * self._values[0x6401, 1] / _COUNTS)
        told = [self._values[entry >> 16, entry >> 8 & 0xFF] for entry in self._mapped(0x1A01)]
        self._say(0x280 + _NODE, struct.pack(f"<{len(told)}h", *told))

    def _mapped(self, mapping: int) -> list[int]:
        return [self._values[mapping, sub] for sub in range(1, self._values[mapping, 0] + 1)]


class Driver(OnABus):
    """Obeys the demand in its command, tells its state each 20 ms, and switches off when none comes for 0.3 s."""

    def __init__(self, hub: Hub) -> None:
        super().__init__(hub)
        self._held, self._count = 0, 0
        hub.after(0.0, self._tick)

    def put(self, percent: float) -> None:
        self._held = round(100.0 * percent)  # mV
        self.stands(percent)

    def expire(self) -> None:
        self.put(0.0)

    def take(self, identifier: int, data: bytes) -> None:
        if identifier == _COMMAND and len(data) == 8 and data[7] == sum(data[:7]) & 0xFF:
            self._hub.at(self.soon(1e-4, 2e-3), lambda: self._obey(data))

    def _obey(self, data: bytes) -> None:
        if not self.is_on:
            return
        self.heard(_PATIENCE_S)
        (millivolts,) = struct.unpack("<h", data[:2])
        if not self.lies and abs(millivolts) <= 10_000:
            self.put(millivolts / 100.0)

    def _tick(self) -> None:
        self._count += 1
        noise = self._hub.draw.randrange(4)
        millivolts = round(1000.0 * self.tells(round(0.1 * self.percent + 0.001 * noise, 3)))
        told = struct.pack("<hhHB", self._held, millivolts, 0, self._count & 0x0F)
        self._say(_STATE, told + bytes([sum(told) & 0xFF]))
        self._hub.after(_EVERY_S, self._tick)
