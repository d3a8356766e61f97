"""Registers of a Modbus device: what stands where in which format, and how numbers become words and back."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

from drivers._part import Part
from hil.daq.calibration import Scale
from hil.daq.channel import Direction, Kind
from hil.description.modbus import Flag
from hil.description.modbus import Type as Format
from hil.description.modbus_place import Table
from hil.errors import SettingError

WordOrder = Literal["big", "little", "ABCD", "CDAB", "BADC", "DCBA"]
"""How the bytes of a number in several registers come: `ABCD` (`big`) with the highest first."""
_LETTERS = {"u16": "H", "s16": "h", "u32": "I", "s32": "i", "f32": "f", "u64": "Q", "s64": "q", "f64": "d"}
FUNCTIONS: Mapping[str, int] = {"coil": 1, "discrete": 2, "holding": 3, "input": 4}
_NAMED: Mapping[str, str] = {"big": "ABCD", "little": "CDAB"}
_HUGE = 10.0  # a float so many times its full scale was put together in the wrong order
_TINY = 1e-8  # of full scale: less than any instrument resolves, but what bytes in the wrong order look like
_NEAR = 1e-2  # of full scale: only from so near a reading comes that close to zero


@dataclass(frozen=True, slots=True)
class Register(Scale):
    """Where a terminal stands in the registers of a device: value = slope · count + offset.

    Attributes:
        table: `input` (read by function 4), `holding` (3), `coil` (1) or `discrete` (2).
        address: counted from 0, as it stands on the wire.
        format: `u16`, `s16`; in two registers `u32`, `s32`, `f32`, in four `u64`, `s64`, `f64`, whose value is the
            number itself. In coils and discrete inputs it is a `bit`, whatever is said.
        read_back: address of an output's read-back, where that is another one; in the holding registers, or where
            `read_back_table` says.
        order: of its bytes, where it is not that of the device; `BA` swaps those of one register.
        bits: lowest bit and number of bits, where the rest of the register is something else.
        write: function that an output is written by; 5 for a coil and 16 for registers if it is 0.
        can_be_read: whether an output can be read back.
        close: how far an output may stand from where it was driven; exactly there if not said.
        invalid: numbers that are no measurement, and what they mean (see `hil.description.terminal.Invalid`).
        status: flags that say that it is none.

    Raises:
        SettingError: a format or table that is not known.
    """

    direction: Direction
    kind: Kind
    unit: str
    low: float
    high: float
    table: Table
    address: int
    format: Format = "u16"
    slope: float = 1.0
    offset: float = 0.0
    read_back: int | None = None
    read_back_table: Table | None = None
    order: str | None = None
    bits: tuple[int, int] | None = None
    write: int = 0
    can_be_read: bool = True
    close: float | None = None
    invalid: Mapping[str, str] = field(default_factory=dict)
    status: tuple[Flag, ...] = ()

    def __post_init__(self) -> None:
        for what, stated, known in (("format", self.format, get_args(Format)), ("table", self.table, FUNCTIONS)):
            if stated not in known:
                raise SettingError(f"register {self.address:#06x}: {what} '{stated}' is not known: {', '.join(known)}")
        if self.direction == "out" and self.table not in ("holding", "coil"):
            raise SettingError(
                f"register {self.address:#06x}: an output is a holding register or a coil, not an {self.table} one"
            )

    @property
    def is_bit(self) -> bool:
        """Whether it stands in a table of bits."""
        return self.table in ("coil", "discrete")

    @property
    def step(self) -> float:
        """What one count more means; 0 for a number with a point of its own, and for what is on or off."""
        counted = not self.is_bit and self.kind != "digital" and _LETTERS[self.format] not in "fd"
        return abs(self.slope) if counted else 0.0

    @property
    def words(self) -> int:
        """Registers, or coils, that it takes."""
        return 1 if self.is_bit else struct.calcsize(_LETTERS[self.format]) // 2

    @property
    def function(self) -> int:
        """By which it is read."""
        return FUNCTIONS[self.table]

    @property
    def writing(self) -> int:
        """By which it is written."""
        return self.write or (5 if self.is_bit else 16)

    @property
    def read_back_at(self) -> tuple[int, int]:
        """Function and address of its read-back."""
        there: Table = self.read_back_table or ("holding" if self.table == "holding" else self.table)
        return FUNCTIONS[there], self.address if self.read_back is None else self.read_back

    @property
    def part(self) -> Part:
        """Where its number stands in its registers, the first of which is the highest."""
        return Part(*self.bits or (0, 1 if self.is_bit else 16 * self.words), self.format.startswith("s"))

    def count_of(self, value: float) -> int:
        """The bits of a value as a whole number, the end of the format where it is beyond; not negative."""
        return self.part.nearest(self.raw_at(value)) & (1 << self.part.width) - 1

    def words_of(self, value: float, order: WordOrder) -> list[int]:
        """A value as the registers take it, first register first; 0 in bits that are none of its own."""
        if self.is_bit:
            return [self.count_of(value)]
        if self.format in ("f32", "f64"):
            data = struct.pack(f">{_LETTERS[self.format]}", self.raw_at(value))
        else:
            data = self.part.put(self.count_of(value)).to_bytes(2 * self.words, "big")
        return _words(self._turned(data, order))

    def mask(self, order: WordOrder) -> list[int]:
        """The bits of the registers that are its own."""
        if self.is_bit:
            return [1]
        return _words(self._turned(self.part.mask.to_bytes(2 * self.words, "big"), order))

    def raw_of(self, words: Sequence[int], order: WordOrder) -> float | int:
        """The count that registers say, signed where its format is; of a float the number."""
        if self.is_bit:
            return int(words[0])
        data = self._turned(struct.pack(f">{len(words)}H", *words), order)
        if self.format in ("f32", "f64"):
            return float(struct.unpack(f">{_LETTERS[self.format]}", data)[0])
        return self.part.of(int.from_bytes(data, "big"))

    def value_of(self, words: Sequence[int], order: WordOrder) -> float:
        """What registers say."""
        return float(self.value_at(self.raw_of(words, order)))

    def why_none(self, words: Sequence[int], order: WordOrder) -> str:
        """What the description says of a number that is no measurement; empty for one that may be."""
        return self.part.why_none(self.raw_of(words, order), self.invalid)

    def measured(self, value: float, before: float | None) -> float:
        """The value, or NaN when it is none: not a number, or a float that only bytes in the wrong order explain.

        Args:
            value: as read.
            before: the reading before it; None when there was none.
        """
        full = max(abs(self.low), abs(self.high))
        if self.format not in ("f32", "f64") or math.isinf(value):
            return value
        far = before is None or not abs(before) <= _NEAR * full
        wrong = abs(value) > _HUGE * full or (0.0 < abs(value) < _TINY * full and far)
        return math.nan if wrong else value

    def _turned(self, data: bytes, order: WordOrder) -> bytes:
        return turned(data, self.order or order)


def turned(data: bytes, order: str) -> bytes:
    """Bytes, highest first, as a byte order puts them on the wire, and back: each of them undoes itself.

    Of one register only `BA` changes anything.
    """
    name = _NAMED.get(order, order)
    words = [data[i : i + 2] for i in range(0, len(data), 2)]
    if name in ("CDAB", "DCBA"):
        words.reverse()
    if name == "BA" or (name in ("BADC", "DCBA") and len(words) > 1):
        words = [word[::-1] for word in words]
    return b"".join(words)


def _words(data: bytes) -> list[int]:
    return list(struct.unpack(f">{len(data) // 2}H", data))
