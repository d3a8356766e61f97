"""A node on CANopen as CiA 301 has it: object dictionary, SDO, PDO, NMT, heartbeats; for twins of devices.

Written after the standard without the library that the drivers use, so that they share no mistake.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping
from contextlib import suppress

from sim_devices._can_bus import Frame
from sim_devices._field import Side

PRE_OPERATIONAL, OPERATIONAL, STOPPED = 0x7F, 0x05, 0x04
MAPPED = 8
"""Entries of a mapping at most."""
_INVALID = 0x80000000  # bit of an identifier: the PDO does not exist
_FLAGS = 0x40000000  # and one that says that it is not asked for by remote frames
_SYNCHRONOUS = range(1, 241)  # transmission types: with every n-th SYNC, taken here as with every one
Place = tuple[int, int]
Objects = Mapping[Place, tuple[str, float, bool]]
"""By index and sub-index: struct format, value after power-on, whether it may be written."""


class Abort(Exception):
    """A transfer that is refused."""

    def __init__(self, code: int) -> None:
        super().__init__(f"{code:#010x}")
        self.code = code


class CanopenNode:
    """A node with an object dictionary. Subclasses say what its objects do.

    Args:
        side: its terminals.
        node: its number.
        objects: its dictionary.
        mapped: entries of a mapping at most.
    """

    answers_by_itself = False

    def __init__(self, side: Side, node: int, objects: Objects, mapped: int = MAPPED) -> None:
        self.side, self.node, self.objects, self._mapped = side, node, objects, mapped
        self.values: dict[Place, float] = {}
        self.nmt = PRE_OPERATIONAL
        self._sent_s = self.ticked_s = side.clock.now_s
        self.master_s = math.inf
        self.unsent: list[Frame] = []
        self._receives = sorted(i for i, sub in objects if 0x1400 <= i < 0x1600 and sub == 1)
        self._sends = sorted(i for i, sub in objects if 0x1800 <= i < 0x1A00 and sub == 1)
        self.power_on()

    def on_frame(self, identifier: int, data: bytes) -> Iterator[Frame]:
        """What the node sends in answer."""
        if identifier == 0x000 and len(data) == 2 and data[1] in (0, self.node):
            yield from self._on_nmt(data[0])
        elif identifier == 0x080 and self.nmt == OPERATIONAL:
            for index in self._sends:
                if self.values.get((index, 2), 0) in _SYNCHRONOUS:
                    yield from self._pdo(index)
        elif (number := self._receiving(identifier)) is not None and self.nmt == OPERATIONAL:
            self._received(number, data)
        elif identifier == 0x600 + self.node and len(data) == 8 and self.nmt != STOPPED:
            yield from self._on_sdo(data)
        elif identifier == 0x700 + (self._consumed >> 16 & 0x7F) and identifier != 0x700:
            self.master_s = self.side.clock.now_s

    def tick(self) -> Iterator[Frame]:
        """Heartbeat, the watch over the master's, and what the device does by itself."""
        now_s = self.side.clock.now_s
        passed_s, self.ticked_s = now_s - self.ticked_s, now_s
        allowed_s = (self._consumed & 0xFFFF) / 1000.0
        if allowed_s and now_s - self.master_s > allowed_s:
            self.master_s = math.inf
            self.missed_heartbeat()
        self.goes_on(passed_s)
        yield from self.unsent
        self.unsent = []
        every_s = self.values.get((0x1017, 0), 0) / 1000.0
        if every_s and now_s - self._sent_s >= every_s:
            self._sent_s = now_s
            yield 0x700 + self.node, bytes([self.nmt])

    def restart(self) -> None:
        """As after power-on: everything forgotten; boot-up message."""
        self.power_on()
        self.unsent.append((0x700 + self.node, b"\x00"))

    def power_on(self) -> None:
        """Every object at its value after power-on."""
        self.values = {place: value for place, (_, value, _) in self.objects.items()}
        self.nmt, self.master_s = PRE_OPERATIONAL, math.inf

    def value(self, index: int, sub: int) -> float:
        """What an object says when it is read."""
        return self.values[index, sub]

    def store(self, index: int, sub: int, value: float) -> None:
        """An object is written."""
        self.values[index, sub] = value
        if index == 0x1016:
            self.master_s = math.inf  # watched from the next heartbeat on

    def check(self, index: int, sub: int, value: float) -> None:
        """Raise `Abort` for a value that an object does not take."""
        if 0x1600 <= index < 0x1800 or 0x1A00 <= index < 0x1C00:
            self._check_mapping(index, sub, int(value))

    def missed_heartbeat(self) -> None:
        """The master fell silent."""

    def goes_on(self, passed_s: float) -> None:
        """Time passed."""

    @property
    def _consumed(self) -> int:
        return int(self.values.get((0x1016, 1), 0))

    def _on_nmt(self, command: int) -> Iterator[Frame]:
        states = {0x01: OPERATIONAL, 0x02: STOPPED, 0x80: PRE_OPERATIONAL}
        if command in states:
            self.nmt = states[command]
        elif command in (0x81, 0x82):
            self.power_on()
            yield 0x700 + self.node, b"\x00"

    def _receiving(self, identifier: int) -> int | None:
        """The communication object of the receive PDO that has this identifier."""
        known = (index for index in self._receives if int(self.values[index, 1]) & ~_FLAGS == identifier)
        return next(known, None)

    def _entries(self, mapping: int) -> list[Place]:
        return [place_of(int(self.values[mapping, sub])) for sub in range(1, int(self.values[mapping, 0]) + 1)]

    def _received(self, index: int, data: bytes) -> None:
        """Store what a receive PDO carries; one that is too short is not taken."""
        places = self._entries(index + 0x200)
        form = "<" + "".join(self.objects[place][0] for place in places)
        if len(data) < struct.calcsize(form):
            return
        for place, value in zip(places, struct.unpack(form, data[: struct.calcsize(form)]), strict=True):
            with suppress(Abort):
                self.check(*place, value)
                self.store(*place, value)

    def _pdo(self, index: int) -> Iterator[Frame]:
        identifier = int(self.values[index, 1])
        data = b"".join(self._packed(*place) for place in self._entries(index + 0x200))
        if not identifier & _INVALID:
            yield identifier & 0x7FF, data

    def _packed(self, index: int, sub: int) -> bytes:
        form, value = self.objects[index, sub][0], self.value(index, sub)
        return struct.pack(f"<{form}", value if form in "fd" else int(value))

    def _on_sdo(self, data: bytes) -> Iterator[Frame]:
        """Expedited transfers, as every object here has four bytes at most."""
        command, index, sub = struct.unpack("<BHB", data[:4])
        try:
            answer = self._transfer(command, index, sub, data[4:])
        except Abort as abort:
            answer = struct.pack("<BHBI", 0x80, index, sub, abort.code)
        if answer:
            yield 0x580 + self.node, answer

    def _transfer(self, command: int, index: int, sub: int, data: bytes) -> bytes:
        if command >> 5 == 4:  # an abort of the client is not answered
            return b""
        if command >> 5 not in (1, 2):
            raise Abort(0x05040001)  # no such command
        if (index, sub) not in self.objects:
            known = any(place[0] == index for place in self.objects)
            raise Abort(0x06090011 if known else 0x06020000)  # no such sub-index, no such object
        form, _, writable = self.objects[index, sub]
        size = struct.calcsize(f"<{form}")
        if command >> 5 == 2:
            return struct.pack("<BHB", 0x43 | (4 - size) << 2, index, sub) + self._packed(index, sub).ljust(4, b"\0")
        if not writable:
            raise Abort(0x06010002)
        if not command & 0b10 or (command & 0b01 and 4 - (command >> 2 & 0b11) != size):
            raise Abort(0x06070010)  # length does not match
        self.check(index, sub, struct.unpack(f"<{form}", data[:size])[0])
        self.store(index, sub, struct.unpack(f"<{form}", data[:size])[0])
        return struct.pack("<BHBI", 0x60, index, sub, 0)

    def _check_mapping(self, index: int, sub: int, value: int) -> None:
        """As CiA 301 has it: entries while there are none in force, then how many are."""
        if sub:
            if self.values[index, 0]:
                raise Abort(0x06010000)  # not while the mapping is in force
            if value:
                self._check_entry(index, value)
            return
        if value > self._mapped:
            raise Abort(0x06040042)  # PDO too long
        bits = 0
        for entry in (int(self.values[index, i]) for i in range(1, value + 1)):
            self._check_entry(index, entry)
            bits += entry & 0xFF
        if bits > 64:
            raise Abort(0x06040042)

    def _check_entry(self, index: int, entry: int) -> None:
        form, _, writable = self.objects.get(place_of(entry), ("", 0, False))
        if not form or 8 * struct.calcsize(f"<{form}") != entry & 0xFF or (index < 0x1A00 and not writable):
            raise Abort(0x06040041)  # cannot be mapped


def place_of(entry: int) -> Place:
    """Index and sub-index of an entry of a mapping."""
    return entry >> 16, entry >> 8 & 0xFF
