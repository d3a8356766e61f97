"""Numbers of a described Modbus terminal as words of its registers, and back."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from typing import Literal

from drivers._part import Part
from hil.daq.calibration import Scale
from hil.description.modbus import WORDS, ModbusDescription, ModbusTerminal, Place
from hil.description.modbus_place import BITS

WordOrder = Literal["big", "little", "ABCD", "CDAB", "BADC", "DCBA"]
"""How the bytes of a number in several registers come: `ABCD` (`big`) with the highest first."""
FUNCTIONS: Mapping[str, int] = {"coil": 1, "discrete": 2, "holding": 3, "input": 4}
_FLOATS: Mapping[str, str] = {"f32": ">f", "f64": ">d"}
_NAMED: Mapping[str, str] = {"big": "ABCD", "little": "CDAB"}
_HUGE = 10.0  # a float so many times its full scale was put together in the wrong order
_TINY = 1e-8  # of full scale: less than any instrument resolves, but what bytes in the wrong order look like
_NEAR = 1e-2  # of full scale: only from so near a reading comes that close to zero


class Encoding(Scale):
    """How the numbers of a terminal stand in the registers of its device: value = slope · count + offset.

    Args:
        terminal: of a description that has its addresses on the wire (`ModbusDescription.on_the_wire`).
        order: of the bytes of more than one register, where the terminal says none.

    Attributes:
        terminal: as above.
        table, address, words: where it stands, and registers, or coils, that it takes.
        function, writing: by which it is read and written.
        read_back_at: function and address of its read-back; `can_be_read`: whether it has one.
        part: where its number stands in its registers, the first of which is the highest.
    """

    def __init__(self, terminal: ModbusTerminal, order: str) -> None:
        form, self.table = terminal.type or "u16", str(terminal.table)
        self.terminal, self.address, self.words = terminal, terminal.address, WORDS[form]
        self.is_bit, self._float = self.table in BITS, _FLOATS.get(form)
        self._order = terminal.byte_order or order
        self.slope, self.offset = terminal.scale
        self.part = Part(*terminal.field or (0, 1 if self.is_bit else 16 * self.words), form.startswith("s"))
        self.function = FUNCTIONS[self.table]
        self.writing = terminal.write or (5 if self.is_bit else 16)
        back = terminal.read_back if isinstance(terminal.read_back, Place) else None
        self.can_be_read = back is not None or terminal.direction == "in"
        self.read_back_at = (FUNCTIONS[str(back.table)], back.address) if back else (self.function, self.address)

    @property
    def mask(self) -> list[int]:
        """The bits of the registers that are its own."""
        return [1] if self.is_bit else self._words(self.part.mask.to_bytes(2 * self.words, "big"))

    def count_of(self, value: float) -> int:
        """The bits of a value as a whole number, the end of the format where it is beyond; not negative."""
        return self.part.nearest(self.raw_at(value)) & (1 << self.part.width) - 1

    def words_of(self, value: float) -> list[int]:
        """A value as the registers take it, first register first; 0 in bits that are none of its own."""
        if self._float:
            return self._words(struct.pack(self._float, self.raw_at(value)))
        count = self.part.put(self.count_of(value))
        return [count] if self.is_bit else self._words(count.to_bytes(2 * self.words, "big"))

    def raw_of(self, words: Sequence[int]) -> float | int:
        """The count that registers say, signed where its format is; of a float the number."""
        if self.is_bit:
            return int(words[0])
        data = turned(struct.pack(f">{len(words)}H", *words), self._order)
        return float(struct.unpack(self._float, data)[0]) if self._float else self.part.of(int.from_bytes(data, "big"))

    def value_of(self, words: Sequence[int]) -> float:
        """What registers say."""
        return float(self.value_at(self.raw_of(words)))

    def why_none(self, words: Sequence[int]) -> str:
        """What the description says of a number that is no measurement; empty for one that may be."""
        return self.part.why_none(self.raw_of(words), self.terminal.invalid)

    def measured(self, value: float, before: float | None) -> float:
        """The value, or NaN when it is none: not a number, or a float that only bytes in the wrong order explain.

        Args:
            value: as read.
            before: the reading before it; None when there was none.
        """
        full = max(map(abs, self.terminal.range))
        if not self._float or math.isinf(value):
            return value
        far = before is None or not abs(before) <= _NEAR * full
        wrong = abs(value) > _HUGE * full or (0.0 < abs(value) < _TINY * full and far)
        return math.nan if wrong else value

    def _words(self, data: bytes) -> list[int]:
        return list(struct.unpack(f">{len(data) // 2}H", turned(data, self._order)))


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


def encodings(described: ModbusDescription, order: str = "") -> dict[str, Encoding]:
    """Those of a device by terminal, in its own byte order if none is given."""
    laid = described.on_the_wire
    return {name: Encoding(t, order or laid.modbus.byte_order) for name, t in laid.terminals.items()}
