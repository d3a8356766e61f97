"""Numbers as the registers of a described device hold them; written without the driver's, so that a slip shows."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

from hil.description.modbus import WORDS, ModbusDescription, ModbusTerminal

_CODES = {"f32": "f", "f64": "d"}
# Places of the bytes of a number on the wire, the highest being 0, by byte order and number of registers.
_PLACES: dict[tuple[str, int], tuple[int, ...]] = {
    ("AB", 1): (0, 1), ("BA", 1): (1, 0),
    ("ABCD", 2): (0, 1, 2, 3), ("CDAB", 2): (2, 3, 0, 1), ("BADC", 2): (1, 0, 3, 2), ("DCBA", 2): (3, 2, 1, 0),
    ("ABCD", 4): (0, 1, 2, 3, 4, 5, 6, 7), ("CDAB", 4): (6, 7, 4, 5, 2, 3, 0, 1),
    ("BADC", 4): (1, 0, 3, 2, 5, 4, 7, 6), ("DCBA", 4): (7, 6, 5, 4, 3, 2, 1, 0),
}  # fmt: skip
SWAPPED = {"ABCD": "CDAB", "CDAB": "ABCD", "BADC": "DCBA", "DCBA": "BADC"}
"""The same with the words in the other order."""
_ORDERS = {"big": "ABCD", "little": "CDAB"}


class Counts:
    """A terminal's numbers in its registers.

    Args:
        description: the description.
        terminal: of it.
        order: of the bytes of more than one register, where the terminal says none.
    """

    def __init__(self, description: ModbusDescription, terminal: ModbusTerminal, order: str) -> None:
        self.terminal, self.form = terminal, description.form_of(terminal)
        self.words = WORDS[self.form]
        own = terminal.byte_order
        self._order = own or (_ORDERS.get(order, order) if self.words > 1 else "AB")
        self._slope, self._offset = terminal.scale
        self._lowest, self._width = terminal.field or (0, 1 if self.form == "bit" else 16 * self.words)
        self._signed = self.form[0] == "s"
        self._real = _CODES.get(self.form)

    def encoded(self, value: float, swapped: bool = False) -> list[int]:
        """The registers of a value, at the end of what they can hold where it is beyond."""
        if self._real is not None:
            return self._laid(struct.pack(">" + self._real, (value - self._offset) / self._slope), swapped)
        if math.isnan(value):
            return self.count(self.no_measurement)
        return self.count(round((value - self._offset) / self._slope))

    def count(self, count: int) -> list[int]:
        """The registers of a count, the rest of them 0."""
        half = 1 << (self._width - 1)
        low, high = (-half, half - 1) if self._signed else (0, 2 * half - 1)
        field = min(max(count, low), high) % (2 * half)
        if self.form == "bit":
            return [field]
        return self._laid((field << self._lowest).to_bytes(2 * self.words, "big"), False)

    def decoded(self, words: Sequence[int]) -> float:
        """The value of registers."""
        if self.form == "bit":
            return words[0] * self._slope + self._offset
        wire = b"".join(word.to_bytes(2, "big") for word in words)
        data = bytearray(len(wire))
        for at, place in enumerate(self._places(False)):
            data[place] = wire[at]
        if self._real is not None:
            return float(struct.unpack(">" + self._real, data)[0]) * self._slope + self._offset
        return self._counted(bytes(data)) * self._slope + self._offset

    def own_bits(self) -> list[int]:
        """The bits of the registers that belong to it."""
        if self.form == "bit":
            return [1]
        return self._laid((((1 << self._width) - 1) << self._lowest).to_bytes(2 * self.words, "big"), False)

    def takes(self, words: Sequence[int]) -> bool:
        """Whether a written count lies within what the description allows."""
        raw = self.terminal.raw
        if raw is None or self._real is not None:
            return True
        count = (self.decoded(words) - self._offset) / self._slope
        return min(raw) - 0.5 <= count <= max(raw) + 0.5

    @property
    def no_measurement(self) -> int:
        """A count that says that there is no measurement, 0 where the description has none."""
        return next((int(count, 0) for count in self.terminal.invalid if count.lower() != "nan"), 0)

    def _counted(self, data: bytes) -> int:
        field = int.from_bytes(data, "big") // (1 << self._lowest) % (1 << self._width)
        return field - (1 << self._width) if self._signed and field >= 1 << (self._width - 1) else field

    def _laid(self, data: bytes, swapped: bool) -> list[int]:
        wire = bytes(data[place] for place in self._places(swapped))
        return [wire[i] << 8 | wire[i + 1] for i in range(0, len(wire), 2)]

    def _places(self, swapped: bool) -> tuple[int, ...]:
        return _PLACES[SWAPPED[self._order] if swapped and self.words > 1 else self._order, self.words]
