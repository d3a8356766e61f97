"""Registers of a Modbus device: what stands where in which format, and which of them go in one request."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

from hil.daq.channel import Direction, Kind
from hil.errors import SettingError

Format = Literal["u16", "s16", "u32", "s32", "f32"]
WordOrder = Literal["big", "little", "ABCD", "CDAB", "BADC", "DCBA"]
"""How the four bytes of a number in two registers come: `ABCD` (`big`) with the highest first."""
_LETTERS = {"u16": "H", "s16": "h", "u32": "I", "s32": "i", "f32": "f"}
_NAMED: Mapping[str, str] = {"big": "ABCD", "little": "CDAB"}
_HUGE = 10.0  # a float so many times its full scale was put together in the wrong order
_TINY = 1e-8  # of full scale: less than any instrument resolves, but what bytes in the wrong order look like
_NEAR = 1e-2  # of full scale: only from so near a reading comes that close to zero


@dataclass(frozen=True, slots=True)
class Register:
    """Where a terminal stands in the registers of a device: value = slope · count + offset.

    Attributes:
        table: `input` (read by function 4) or `holding` (3, 6, 16).
        address: counted from 0, as it stands on the wire.
        format: `u16`, `s16`; in two registers `u32`, `s32`, `f32`, whose value is the number itself.
        read_back: address of an output's read-back in the holding registers, where that is another one.

    Raises:
        SettingError: a format or table that is not known.
    """

    direction: Direction
    kind: Kind
    unit: str
    low: float
    high: float
    table: Literal["input", "holding"]
    address: int
    format: Format = "u16"
    slope: float = 1.0
    offset: float = 0.0
    read_back: int | None = None

    def __post_init__(self) -> None:
        for what, said, known in (("format", self.format, get_args(Format)), ("table", self.table, _FUNCTIONS)):
            if said not in known:
                raise SettingError(f"register {self.address:#06x}: {what} '{said}' is not known: {', '.join(known)}")
        if self.direction == "out" and self.table != "holding":
            raise SettingError(
                f"register {self.address:#06x}: an output is a holding register, not an {self.table} one"
            )

    @property
    def words(self) -> int:
        """Registers that it takes."""
        return struct.calcsize(_LETTERS[self.format]) // 2

    @property
    def function(self) -> int:
        """By which it is read."""
        return _FUNCTIONS[self.table]

    def count_of(self, value: float) -> int:
        """A value as a register of whole numbers takes it, the end of the format where it is beyond; not negative."""
        bits = 16 * self.words
        least = -(1 << bits - 1) if self.format.startswith("s") else 0
        count = max(least, min(least + (1 << bits) - 1, round((value - self.offset) / self.slope)))
        return count & (1 << bits) - 1

    def words_of(self, value: float, order: WordOrder) -> list[int]:
        """A value as the registers take it, first register first."""
        if self.format == "f32":
            data = struct.pack(">f", (value - self.offset) / self.slope)
        else:
            data = self.count_of(value).to_bytes(2 * self.words, "big")
        return list(struct.unpack(f">{self.words}H", _on_the_wire(data, order)))

    def value_of(self, words: Sequence[int], order: WordOrder) -> float:
        """What registers say."""
        data = _highest_first(struct.pack(f">{len(words)}H", *words), order)
        (count,) = struct.unpack(f">{_LETTERS[self.format]}", data)
        return float(self.slope * count + self.offset)

    def measured(self, value: float, before: float | None) -> float:
        """The value, or NaN when it is none: not a number, or a float that only bytes in the wrong order explain.

        Args:
            value: as read.
            before: the reading before it; None when there was none.
        """
        full = max(abs(self.low), abs(self.high))
        if self.format != "f32" or math.isinf(value):
            return value
        far = before is None or not abs(before) <= _NEAR * full
        wrong = abs(value) > _HUGE * full or (0.0 < abs(value) < _TINY * full and far)
        return math.nan if wrong else value


_FUNCTIONS: Mapping[str, int] = {"holding": 3, "input": 4}


def float32(words: Sequence[int], order: WordOrder) -> float:
    """Two registers as a floating-point number."""
    return float(struct.unpack(">f", _highest_first(struct.pack(">2H", *words), order))[0])


def _highest_first(data: bytes, order: WordOrder) -> bytes:
    name = _NAMED.get(order, order)
    return data if len(data) != 4 else bytes(data[name.index(letter)] for letter in "ABCD")


def _on_the_wire(data: bytes, order: WordOrder) -> bytes:
    return data if len(data) != 4 else bytes(data["ABCD".index(letter)] for letter in _NAMED.get(order, order))


@dataclass(slots=True)
class Stretch:
    """Neighbouring registers of one table that go in one request."""

    first: int
    terminals: dict[str, Register] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Registers from the first to the last."""
        last = self._last
        return last.address + last.words - self.first

    @property
    def function(self) -> int:
        """By which they are read."""
        return self._last.function

    @property
    def read_back(self) -> int:
        """Where the outputs among them are read back, the first one first."""
        first = next(iter(self.terminals.values()))
        return first.address if first.read_back is None else first.read_back

    def split(self, words: Sequence[int]) -> dict[str, tuple[int, ...]]:
        """The words of each terminal, of those that one request brought."""
        return {name: tuple(words[r.address - self.first :][: r.words]) for name, r in self.terminals.items()}

    def takes(self, register: Register) -> bool:
        """Whether a register goes on where these end, also in its read-back."""
        last = self._last
        apart = None if register.read_back is None else register.read_back - register.address
        same = apart == (None if last.read_back is None else last.read_back - last.address)
        return register.table == last.table and register.address == last.address + last.words and same

    @property
    def _last(self) -> Register:
        return next(reversed(self.terminals.values()))


def stretches(registers: Mapping[str, Register]) -> list[Stretch]:
    """Registers in as few requests as possible without asking for any that lie between (some devices refuse)."""
    found: list[Stretch] = []
    for name, register in sorted(registers.items(), key=lambda item: (item[1].table, item[1].address)):
        if not found or not found[-1].takes(register):
            found.append(Stretch(register.address))
        found[-1].terminals[name] = register
    return found
