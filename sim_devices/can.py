"""Devices on CAN and J1939 by a DBC file, with a plant behind their signals; the twin of the driver."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from hil.description.can import CanDescription, CanTerminal
from sim_devices._bits import Bits
from sim_devices._can_bus import Frame, serve_node
from sim_devices._field import Side
from sim_devices._twin import described_in, offered

_EVERY_S = 0.05  # between messages of which the description does not say it


class DescribedNode:
    """Obeys the commands of the description whose checksum fits, tells its signals again and again.

    When no command comes for the watchdog's time, outputs go where the description says.
    """

    answers_by_itself = True

    def __init__(self, side: Side, description: CanDescription) -> None:
        self._side, self._description = side, description
        self._messages = {message.name: message for message in description.database.messages}
        self._outputs = {name: t for name, t in description.terminals.items() if t.direction == "out"}
        self._tells = sorted(
            {t.message for t in description.terminals.values() if t.direction == "in"}
            | {t.read_back.message for t in self._outputs.values() if t.read_back}
        )
        self._commanded = {t.message for t in self._outputs.values()}
        self._counts = dict.fromkeys(self._tells, 0)
        self._sent_s = dict.fromkeys(self._tells, side.clock.now_s)
        self._heard_s = side.clock.now_s

    def on_frame(self, identifier: int, data: bytes) -> Iterator[Frame]:
        """A command is obeyed; where it stands is said at once."""
        for name in self._commanded:
            message = self._messages[name]
            if self._is_for(message, identifier) and len(data) >= message.length and self._fits(name, data):
                self._obey(name, data)
                yield from (self._frame(name_) for name_ in self._read_backs())

    def tick(self) -> Iterator[Frame]:
        """Every message in its time; outputs where they go when no command came."""
        now_s, watchdog = self._side.clock.now_s, self._description.watchdog
        if watchdog is not None and now_s - self._heard_s > watchdog.time_s:
            for name in self._outputs:
                if self._side.standing(name) != watchdog.expires_to:
                    self._side.drive({name: watchdog.expires_to})
        for name in self._tells:
            if now_s - self._sent_s[name] >= (self._description.about(name).every_s or _EVERY_S):
                self._sent_s[name] = now_s
                yield self._frame(name)

    def restart(self) -> None:
        """Outputs where they go without a command."""
        level = self._description.watchdog.expires_to if self._description.watchdog else 0.0
        self._side.drive(dict.fromkeys(self._outputs, level))
        self._counts = dict.fromkeys(self._tells, 0)

    def _obey(self, name: str, data: bytes) -> None:
        self._heard_s = self._side.clock.now_s
        for terminal, described in self._outputs.items():
            if described.message == name and self._is_chosen(described, data):
                self._side.drive({terminal: self._value(described, data)})

    def _is_chosen(self, terminal: CanTerminal, data: bytes) -> bool:
        """Whether a multiplexed signal is in this message."""
        message = self._messages[terminal.message]
        signal = message.get_signal_by_name(terminal.signal)
        if not signal.multiplexer_ids:
            return True
        return bits_of(message.get_signal_by_name(signal.multiplexer_signal)).taken(data) in signal.multiplexer_ids

    def _value(self, terminal: CanTerminal, data: bytes) -> float:
        message = self._messages[terminal.message]
        signal, sign = message.get_signal_by_name(terminal.signal), self._description.about(terminal.message).sign
        value = bits_of(signal).taken(data) * signal.scale + signal.offset
        if sign is not None:
            value *= {sign.above: 1, sign.below: -1}.get(
                int(bits_of(message.get_signal_by_name(sign.signal)).taken(data)), 0
            )
        return float(terminal.value_at(value))

    def _read_backs(self) -> list[str]:
        return sorted({t.read_back.message for t in self._outputs.values() if t.read_back})

    def _frame(self, name: str) -> Frame:
        """A message with all that the description has in it; other bits as in a message of which nothing is known."""
        message, about = self._messages[name], self._description.about(name)
        data = bytearray(([0xFF] if self._description.j1939 else [0x00]) * message.length)
        readings = self._side.read()
        for signal, count in about.values.items():
            bits_of(message.get_signal_by_name(signal)).put(data, count)
        for terminal, described in self._description.terminals.items():
            if described.direction == "in" and described.message == name:
                self._put(data, described, described.signal, readings.get(terminal, 0.0))
            if described.read_back is not None and described.read_back.message == name:
                self._put(data, described, described.read_back.signal, self._side.standing(terminal), name)
        if about.counter:
            signal = message.get_signal_by_name(about.counter)
            bits_of(signal).put(data, self._counts[name] % (1 << signal.length))
            self._counts[name] += 1
        if about.checksum is not None:
            at = message.get_signal_by_name(about.checksum.signal).start // 8
            data[at] = _sum(about.checksum.kind, bytes(data[:at] + data[at + 1 :]))
        return self._identifier(message), bytes(data)

    def _put(self, data: bytearray, terminal: CanTerminal, name: str, value: float, in_message: str = "") -> None:
        message = self._messages[in_message or terminal.message]
        signal, sign = message.get_signal_by_name(name), self._description.about(message.name).sign
        if math.isnan(value):
            bits_of(signal).put(data, (1 << signal.length) - 1)
            return
        number = terminal.raw_at(value)
        if sign is not None:
            bits_of(message.get_signal_by_name(sign.signal)).put(data,
                sign.zero if number == 0 else sign.above if number > 0 else sign.below)  # fmt: skip
            number = abs(number)
        count = (number - signal.offset) / signal.scale
        high = (0xFB << signal.length - 8) - 1 if self._description.j1939 and signal.length >= 8 else math.inf
        bits_of(signal).put(data, min(count, high))

    def _fits(self, name: str, data: bytes) -> bool:
        about = self._description.about(name)
        if about.checksum is None:
            return True
        at = self._messages[name].get_signal_by_name(about.checksum.signal).start // 8
        return bool(data[at] == _sum(about.checksum.kind, data[:at] + data[at + 1 :]))

    def _is_for(self, message: Any, identifier: int) -> bool:
        if self._description.j1939 is None:
            return bool(message.frame_id == identifier)
        return _group(message.frame_id) == _group(identifier) and identifier > 0x7FF

    def _identifier(self, message: Any) -> int:
        if self._description.j1939 is None:
            return int(message.frame_id)
        return int(message.frame_id & ~0xFF | self._description.j1939.device)


def bits_of(signal: Any) -> Bits:
    """Where the bits of a signal of a DBC file stand in its message."""
    byte, bit = divmod(signal.start, 8)
    places = [divmod(signal.start + i, 8) for i in range(signal.length)]
    if signal.byte_order == "big_endian":  # from the highest down: 7 … 0 of a byte, then on in the next
        places = [(byte + (7 - bit + i) // 8, 7 - (7 - bit + i) % 8) for i in reversed(range(signal.length))]
    return Bits(tuple(places), signal.is_signed, signal.is_float)


def _group(identifier: int) -> int:
    form = identifier >> 16 & 0xFF
    return identifier >> 16 & 0x3FF if form < 0xF0 else identifier >> 8 & 0x3FFFF


_TABLE = [0] * 256
for _first in range(256):
    _rest = _first
    for _ in range(8):
        _rest = ((_rest * 2) ^ (0x11D if _rest >= 0x80 else 0)) & 0xFF
    _TABLE[_first] = _rest


def _sum(kind: str, data: bytes) -> int:
    total = 0xFF if kind == "crc8" else 0
    for byte in data:
        total = {"xor": total ^ byte, "sum": total + byte & 0xFF, "crc8": _TABLE[total ^ byte]}[kind]
    return total ^ 0xFF if kind == "crc8" else total


Settings, faults, terminals, open_daq, serve, quirks, world = offered(
    "can", serve_node, lambda settings, side: DescribedNode(side, described_in(settings, "can")), "virtual:hil"
)
