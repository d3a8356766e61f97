"""A proportional valve on CANopen after CiA 408, with a plant behind its spool; the twin of the driver.

Written after the profile and CiA 301 without the library that the driver uses, so that they share no mistake.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping
from typing import Any

from sim_devices._can_bus import CanServer, Frame
from sim_devices._field import Side
from sim_devices._quirks import Quirks
from sim_devices._twin import Twin, TwinSettings, quirks, world

__all__ = ["Settings", "faults", "open_daq", "quirks", "serve", "terminals", "world"]

_FULL = 16384
_PRE_OPERATIONAL, _OPERATIONAL, _STOPPED = 0x7F, 0x05, 0x04
_INIT, _DISABLED, _HOLD, _ACTIVE, _FAULT_HOLD = 0b1000, 0b1001, 0b1011, 0b1111, 0b0011
_STEPS = {  # what the low three bits of the control word ask for, from where it is reached
    0b000: (_INIT, (_DISABLED,)),
    0b001: (_DISABLED, (_INIT, _HOLD)),
    0b011: (_HOLD, (_DISABLED, _ACTIVE)),
    0b111: (_ACTIVE, (_HOLD,)),
}

_RPDOS = {  # by CiA 408: what each receive PDO carries after power-on, and its identifier without the node
    0: (0x200, (0x60400010,)),
    1: (0x300, (0x60400010, 0x63000110)),
    2: (0x400, (0x60400010, 0x63800110)),
    3: (0x500, (0x60400010, 0x63000110, 0x63800110)),
}
_MAPPED = 4  # entries of a mapping at most
_INVALID = 0x80000000  # bit of an identifier: the PDO does not exist

# Index, sub-index: struct format, value after power-on, whether it may be written. Analogue objects are records of
# value, SI unit and prefix.
_OBJECTS: dict[tuple[int, int], tuple[str, int, bool]] = {
    (0x1000, 0): ("I", 408, False), (0x1001, 0): ("B", 0, False), (0x1005, 0): ("I", 0x80, False),
    (0x1016, 0): ("B", 1, False), (0x1016, 1): ("I", 0, True), (0x1017, 0): ("H", 0, True),
    (0x1018, 0): ("B", 1, False), (0x1018, 1): ("I", 0, False),
    (0x6040, 0): ("H", 0, True), (0x6041, 0): ("H", 0, False), (0x6042, 0): ("b", 1, True), (0x6043, 0): ("b", 2, True),
    (0x604F, 0): ("b", 0, True), (0x6330, 0): ("b", 0, True), (0x6342, 0): ("b", 0, True), (0x6360, 0): ("b", 0, True),
    **{(index, sub): (form if sub == 1 else ("B" if sub == 2 else "b"), value if sub == 1 else prefix * (sub == 3),
                      sub == 1 and index != 0x6301)
       for index, form, value, prefix in (
           (0x6300, "h", 0, 0), (0x6301, "h", 0, 0), (0x6311, "h", _FULL, 0), (0x6314, "h", 0, 0),
           (0x6331, "H", 0, -3), (0x6343, "h", 0, 0), (0x6344, "h", 0, 0), (0x6361, "H", 0, 0), (0x6362, "H", 0, 0),
           (0x6380, "h", 0, 0))
       for sub in (1, 2, 3)},
    **{(index, 0): ("B", 3, False)
       for index in (0x6300, 0x6301, 0x6311, 0x6314, 0x6331, 0x6343, 0x6344, 0x6361, 0x6362, 0x6380)},
}  # fmt: skip


def _objects(node: int) -> dict[tuple[int, int], tuple[str, int, bool]]:
    """The object dictionary after power-on; identifiers are those of the predefined connection set."""
    found = dict(_OBJECTS)
    found[0x1014, 0] = ("I", 0x80 + node, False)
    for number, (base, entries) in _RPDOS.items():
        found |= _pdo_objects(0x1400 + number, base + node, 0x1600 + number, entries)
    return found | _pdo_objects(0x1800, 0x180 + node, 0x1A00, ())


def _pdo_objects(
    communication: int, identifier: int, mapping: int, entries: tuple[int, ...]
) -> dict[tuple[int, int], tuple[str, int, bool]]:
    padded = (*entries, *[0] * (_MAPPED - len(entries)))
    return {
        (communication, 0): ("B", 2, False), (communication, 1): ("I", identifier, True),
        (communication, 2): ("B", 255, True), (mapping, 0): ("B", len(entries), True),
        **{(mapping, i + 1): ("I", entry, True) for i, entry in enumerate(padded)},
    }  # fmt: skip


class _Abort(Exception):
    def __init__(self, code: int) -> None:
        super().__init__(f"{code:#010x}")
        self.code = code


class Valve:
    """A node with the state machine of the profile.

    Only in ACTIVE the set point, through its ramp if one is set, moves the spool; in HOLD it is the hold set point,
    in every other state the spool stands at its fail-safe position. A missed heartbeat of the master is a fault.

    Args:
        side: its terminals, `set point` and `actual value` in %.
        node: its number.
    """

    answers_by_itself = False

    def __init__(self, side: Side, node: int) -> None:
        self._side, self._node = side, node
        self._objects = _objects(node)
        self.values: dict[tuple[int, int], int] = {}
        self._state, self._nmt, self._word = _INIT, _PRE_OPERATIONAL, 0
        self._said_s = self._ticked_s = side.clock.now_s
        self._master_s = math.inf
        self._spool = 0.0
        self._unsent: list[Frame] = []
        self._power_on()

    def on_frame(self, identifier: int, data: bytes) -> Iterator[Frame]:
        """What the node sends in answer."""
        if identifier == 0x000 and len(data) == 2 and data[1] in (0, self._node):
            yield from self._on_nmt(data[0])
        elif identifier == 0x080 and self._nmt == _OPERATIONAL and self.values[0x1800, 2] == 1:
            yield from self._pdo()
        elif (number := self._rpdo(identifier)) is not None and self._nmt == _OPERATIONAL:
            self._received(number, data)
        elif identifier == 0x600 + self._node and len(data) == 8 and self._nmt != _STOPPED:
            yield from self._on_sdo(data)
        elif identifier == 0x700 + (self.values[0x1016, 1] >> 16 & 0x7F) and identifier != 0x700:
            self._master_s = self._side.clock.now_s

    def tick(self) -> Iterator[Frame]:
        """Heartbeat, the watch over the master's, ramp."""
        now_s = self._side.clock.now_s
        passed_s, self._ticked_s = now_s - self._ticked_s, now_s
        allowed_s = (self.values[0x1016, 1] & 0xFFFF) / 1000.0
        if allowed_s and now_s - self._master_s > allowed_s:
            self._fault(0x8130)
        self._move(passed_s)
        yield from self._unsent
        self._unsent = []
        every_s = self.values[0x1017, 0] / 1000.0
        if every_s and now_s - self._said_s >= every_s:
            self._said_s = now_s
            yield 0x700 + self._node, bytes([self._nmt])

    def restart(self) -> None:
        """As after power-on: everything forgotten, spool at its fail-safe position, boot-up message."""
        self._power_on()
        self._unsent.append((0x700 + self._node, b"\x00"))

    def _power_on(self) -> None:
        self.values = {place: value for place, (_, value, _) in self._objects.items()}
        self._state, self._nmt, self._word, self._master_s = _INIT, _PRE_OPERATIONAL, 0, math.inf
        self._spool = 0.0
        self._side.drive({"set point": 0.0})

    def _on_nmt(self, command: int) -> Iterator[Frame]:
        states = {0x01: _OPERATIONAL, 0x02: _STOPPED, 0x80: _PRE_OPERATIONAL}
        if command in states:
            self._nmt = states[command]
        elif command in (0x81, 0x82):
            self._power_on()
            yield 0x700 + self._node, b"\x00"

    def _rpdo(self, identifier: int) -> int | None:
        """The receive PDO that has this identifier."""
        return next((n for n in _RPDOS if self.values[0x1400 + n, 1] == identifier), None)

    def _received(self, number: int, data: bytes) -> None:
        """Store what a receive PDO carries; one that is too short is not taken."""
        places = [_place(self.values[0x1600 + number, sub]) for sub in range(1, self.values[0x1600 + number, 0] + 1)]
        form = "<" + "".join(self._objects[place][0] for place in places)
        if len(data) < struct.calcsize(form):
            return
        for place, value in zip(places, struct.unpack(form, data[: struct.calcsize(form)]), strict=True):
            if place != (0x6300, 1) or abs(value) <= _FULL:
                self._store(*place, value)

    def _pdo(self) -> Iterator[Frame]:
        identifier, data = self.values[0x1800, 1], b""
        for sub in range(1, self.values[0x1A00, 0] + 1):
            place = _place(self.values[0x1A00, sub])
            data += struct.pack(f"<{self._objects[place][0]}", self._value(*place))
        if not identifier & _INVALID:
            yield identifier & 0x7FF, data

    def _on_sdo(self, data: bytes) -> Iterator[Frame]:
        """Expedited transfers, as every object here has four bytes at most."""
        command, index, sub = struct.unpack("<BHB", data[:4])
        try:
            answer = self._transfer(command, index, sub, data[4:])
        except _Abort as abort:
            answer = struct.pack("<BHBI", 0x80, index, sub, abort.code)
        if answer:
            yield 0x580 + self._node, answer

    def _transfer(self, command: int, index: int, sub: int, data: bytes) -> bytes:
        if command >> 5 == 4:  # an abort of the client is not answered
            return b""
        if command >> 5 not in (1, 2):
            raise _Abort(0x05040001)  # no such command
        if (index, sub) not in self._objects:
            known = any(place[0] == index for place in self._objects)
            raise _Abort(0x06090011 if known else 0x06020000)  # no such sub-index, no such object
        form, _, writable = self._objects[index, sub]
        size = struct.calcsize(f"<{form}")
        if command >> 5 == 2:
            packed = struct.pack(f"<{form}", self._value(index, sub))
            return struct.pack("<BHB", 0x43 | (4 - size) << 2, index, sub) + packed.ljust(4, b"\0")
        if not writable:
            raise _Abort(0x06010002)
        if not command & 0b10 or (command & 0b01 and 4 - (command >> 2 & 0b11) != size):
            raise _Abort(0x06070010)  # length does not match
        self._check(index, sub, struct.unpack(f"<{form}", data[:size])[0])
        self._store(index, sub, struct.unpack(f"<{form}", data[:size])[0])
        return struct.pack("<BHBI", 0x60, index, sub, 0)

    def _check(self, index: int, sub: int, value: int) -> None:
        if index == 0x6300 and abs(value) > _FULL:
            raise _Abort(0x06090030)  # value range
        if index in (*range(0x1600, 0x1604), 0x1A00):
            self._check_mapping(index, sub, value)

    def _check_mapping(self, index: int, sub: int, value: int) -> None:
        """As CiA 301 has it: entries while there are none in force, then how many are."""
        if sub:
            if self.values[index, 0]:
                raise _Abort(0x06010000)  # not while the mapping is in force
            if value:
                self._check_entry(index, value)
            return
        if value > _MAPPED:
            raise _Abort(0x06040042)  # PDO too long
        bits = 0
        for entry in (self.values[index, i] for i in range(1, value + 1)):
            self._check_entry(index, entry)
            bits += entry & 0xFF
        if bits > 64:
            raise _Abort(0x06040042)

    def _check_entry(self, index: int, entry: int) -> None:
        form, _, writable = self._objects.get(_place(entry), ("", 0, False))
        if not form or 8 * struct.calcsize(f"<{form}") != entry & 0xFF or (index < 0x1A00 and not writable):
            raise _Abort(0x06040041)  # cannot be mapped

    def _value(self, index: int, sub: int) -> int:
        if index == 0x6041:
            return self._state
        if (index, sub) == (0x6301, 1):
            percent = self._side.number("actual value")
            return max(-0x8000, min(0x7FFF, round(percent * _FULL / 100.0)))
        return self.values[index, sub]

    def _store(self, index: int, sub: int, value: int) -> None:
        self.values[index, sub] = value
        if index == 0x6040:
            self._control(value)
        if index == 0x1016:
            self._master_s = math.inf  # watched from the next heartbeat on
        if index in (0x6040, 0x6300, 0x6314):
            self._move(0.0)

    def _control(self, word: int) -> None:
        before, self._word = self._word, word
        if not self._state & 0b1000:  # a fault; reset by a rising edge of bit 3
            if word & 0b1000 and not before & 0b1000:
                self._state = {0b001: _DISABLED, 0b011: _HOLD}.get(word & 0b111, _INIT)
                self._master_s, self.values[0x1001, 0] = math.inf, 0
            return
        state, origins = _STEPS.get(word & 0b111, (self._state, ()))
        if self._state in origins:
            self._state = state

    def _fault(self, code: int) -> None:
        self._master_s = math.inf
        if self._state & 0b1000:
            self._state, self.values[0x1001, 0] = _FAULT_HOLD, 0x11
            self._unsent.append((0x080 + self._node, struct.pack("<HB5x", code, 0x11)))

    def _move(self, passed_s: float) -> None:
        """Bring the spool's demand to where state and ramp let it go."""
        active = self._state == _ACTIVE and self.values[0x6042, 0] == 1
        if active:
            wanted = 100.0 * self.values[0x6300, 1] / _FULL
        elif self._state in (_HOLD, _FAULT_HOLD):
            wanted = 100.0 * self.values[0x6314, 1] / _FULL
        else:
            wanted = 0.0
        ramp_s = self.values[0x6331, 1] / 1000.0 if active and self.values[0x6330, 0] else 0.0
        most = 100.0 * passed_s / ramp_s if ramp_s else math.inf
        self._spool += max(-most, min(most, wanted - self._spool))
        if self._side.standing("set point") != self._spool:
            self._side.drive({"set point": self._spool})


def _place(entry: int) -> tuple[int, int]:
    """Index and sub-index of an entry of a mapping."""
    return entry >> 16, entry >> 8 & 0xFF


def serve(settings: Mapping[str, Any], side: Side, behave: Quirks) -> CanServer:
    """Serve the valve on the bus where the driver will look for it."""
    return CanServer(Valve(side, int(settings.get("node", 1))), side, behave, str(settings["address"]))


_twin = Twin("canopen_valve", serve, example="virtual:hil", free="virtual:hil")
Settings, faults, terminals, open_daq = TwinSettings, _twin.faults, _twin.terminals, _twin.open_daq
