"""Messages of a DBC file as a bench sends and believes them: values to frames and back, counters, checksums."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import reduce
from typing import Any

from drivers._edge import message_of
from drivers._part import Part
from hil.description.can import CanDescription, CanTerminal, Message
from hil.errors import LinkError

_LAST_VALID = 0xFA  # of the highest byte, in SAE J1939; above it are errors and "not available"
_LOWEST_PDU2 = 240  # of the PDU format: from here on a message is for everybody, and the address is part of the group


def group_of(identifier: int) -> int:
    """The parameter group of a J1939 identifier; the address that a message is for is no part of it."""
    group = identifier >> 8 & 0x3FFFF
    return group if group >> 8 & 0xFF >= _LOWEST_PDU2 else group & 0x3FF00


def checksum(kind: str, data: bytes) -> int:
    """Of the bytes of a message without its own."""
    if kind == "xor":
        return reduce(lambda total, byte: total ^ byte, data, 0)
    if kind == "sum":
        return sum(data) & 0xFF
    crc = 0xFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x1D if crc & 0x80 else crc << 1) & 0xFF
    return crc ^ 0xFF


@dataclass(slots=True)
class Sent:
    """A message that is sent: its signals, kept from one time to the next.

    Attributes:
        message: of the DBC file.
        about: what the description says of it.
        raw: counts by signal.
    """

    message: Any
    about: Message
    is_j1939: bool
    raw: dict[str, float] = field(default_factory=dict)
    counts: int = 0

    def __post_init__(self) -> None:
        for signal in self.message.signals:
            self.raw[signal.name] = (1 << signal.length) - 1 if self.is_j1939 and not signal.is_signed else 0
        for name, value in self.about.values.items():
            self.raw[name] = self.counted(name, value)

    def counted(self, name: str, value: float) -> float:
        """A value as the signal takes it, its end where it is beyond."""
        signal = self.message.get_signal_by_name(name)
        if signal.is_float:
            return float((value - signal.offset) / signal.scale)
        count = Part(0, signal.length, signal.is_signed).nearest((value - signal.offset) / signal.scale)
        if self.is_j1939 and not signal.is_signed and signal.length >= 8:
            count = min(count, (_LAST_VALID + 1 << signal.length - 8) - 1)
        return count

    def set(self, terminal: CanTerminal, value: float) -> float:
        """Put a terminal's value in; returns the value that then stands there."""
        number = terminal.raw_at(value)
        sign = self.about.sign
        size = abs(number) if sign is not None else number
        count = self.raw[terminal.signal] = self.counted(terminal.signal, size)
        signal = self.message.get_signal_by_name(terminal.signal)
        stands = float(count * signal.scale + signal.offset)
        if sign is not None:
            way = 0 if stands == 0.0 else math.copysign(1, number)
            self.raw[sign.signal] = {0: sign.zero, 1: sign.above, -1: sign.below}[int(way)]
            stands *= way
        return terminal.value_at(stands)

    def frame(self) -> bytes:
        """Its bytes now, with the next count and a checksum that fits."""
        if self.about.counter:
            length = self.message.get_signal_by_name(self.about.counter).length
            self.raw[self.about.counter] = self.counts & (1 << length) - 1
            self.counts += 1
        data = bytearray(self.message.encode(self.raw, scaling=False, padding=self.is_j1939, strict=False))
        if self.about.checksum is not None:
            at = _byte_of(self.message, self.about.checksum.signal)
            data[at] = checksum(self.about.checksum.kind, bytes(data[:at] + data[at + 1 :]))
        return bytes(data)


@dataclass(slots=True)
class Received:
    """A message that is read: the signals that came last, and whether it can be believed.

    Attributes:
        counts: of each signal as they came last, by name.
        came_s: when a signal came last, by name.
        broken: why the last message was not believed; empty when it was.
    """

    message: Any
    about: Message
    is_j1939: bool
    values: dict[str, float] = field(default_factory=dict)
    counts: dict[str, float] = field(default_factory=dict)
    came_s: dict[str, float] = field(default_factory=dict)
    broken: str = ""
    still: int = 0
    count: int = -1

    def take(self, data: bytes, now_s: float) -> None:
        """Take in a message that came now."""
        self.broken = self._fault(data)
        if self.broken:
            return
        try:
            raw: Mapping[str, Any] = self.message.decode(
                data, scaling=False, decode_choices=False, allow_truncated=True
            )
        except Exception as error:  # of the library: a page that the file does not have is none of ours
            self.broken = message_of(error)
            return
        for name, count in raw.items():
            self.counts[name] = count
            signal = self.message.get_signal_by_name(name)
            value = float(count * signal.scale + signal.offset)
            self.values[name] = math.nan if self._is_none(signal, count) else value
            self.came_s[name] = now_s
        if self.about.counter:
            self.still = self.still + 1 if raw[self.about.counter] == self.count else 0
            self.count = int(raw[self.about.counter])

    def value(self, terminal: Any, now_s: float) -> float:
        """What a signal says.

        Raises:
            LinkError: it is too old, or its message cannot be believed.
        """
        name = f"{self.message.name}.{terminal.signal}"
        if self.still >= 2:
            raise LinkError(f"{name}: the counter {self.about.counter} stands still: its sender hangs")
        if terminal.signal not in self.came_s or now_s - self.came_s[terminal.signal] > self.about.timeout_s:
            why = f"; the last one was not believed: {self.broken}" if self.broken else ""
            raise LinkError(f"no {name} for {self.about.timeout_s:g} s{why}")
        value = math.nan if self.why_none(terminal) else self.values[terminal.signal]
        sign = self.about.sign
        if sign is not None:
            value *= {sign.above: 1.0, sign.below: -1.0, sign.zero: 0.0}.get(int(self.values[sign.signal]), math.nan)
        return value

    def why_none(self, terminal: Any) -> str:
        """Why what came last is no measurement, in words; empty where it is one."""
        count = self.counts.get(terminal.signal, 0)
        signal = self.message.get_signal_by_name(terminal.signal)
        why = Part(0, signal.length).why_none(count, getattr(terminal, "invalid", {}))
        return why or "the device says that it has none" * self._is_none(signal, count)

    def _fault(self, data: bytes) -> str:
        if len(data) < self.message.length:
            return f"{len(data)} bytes, not {self.message.length}"
        if self.about.checksum is None:
            return ""
        at = _byte_of(self.message, self.about.checksum.signal)
        fits = data[at] == checksum(self.about.checksum.kind, data[:at] + data[at + 1 :])
        return "" if fits else "its checksum does not fit"

    def _is_none(self, signal: Any, count: float) -> bool:
        if signal.is_float:
            return math.isnan(count)
        if not self.is_j1939 or signal.is_signed:
            return False
        if signal.length < 8:
            return bool(signal.length == 2 and count == 3)
        return bool(int(count) >> signal.length - 8 > _LAST_VALID)


def _byte_of(message: Any, signal: str) -> int:
    return int(message.get_signal_by_name(signal).start) // 8


def sent_messages(description: CanDescription, terminals: Mapping[str, CanTerminal]) -> dict[str, Sent]:
    """The messages that carry these outputs, by name."""
    names = dict.fromkeys(terminal.message for terminal in terminals.values())
    found = description.database.get_message_by_name
    return {name: Sent(found(name), description.about(name), description.j1939 is not None) for name in names}


def received_messages(description: CanDescription, names: set[str]) -> dict[str, Received]:
    """Messages that are read, by name."""
    found, is_j1939 = description.database.get_message_by_name, description.j1939 is not None
    return {name: Received(found(name), description.about(name), is_j1939) for name in sorted(names)}
