"""Numbers as the registers of a described device hold them."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from hil.description.modbus import WORDS, ModbusTerminal
from hil.description.terminal import counts_of
from sim_devices._bits import Bits

# Places of the eight bytes of a number on the wire, the highest being 0; of fewer bytes the order's name says them.
_EIGHT = {
    "ABCD": (0, 1, 2, 3, 4, 5, 6, 7), "CDAB": (6, 7, 4, 5, 2, 3, 0, 1),
    "BADC": (1, 0, 3, 2, 5, 4, 7, 6), "DCBA": (7, 6, 5, 4, 3, 2, 1, 0),
}  # fmt: skip
_SWAPPED = {"ABCD": "CDAB", "CDAB": "ABCD", "BADC": "DCBA", "DCBA": "BADC"}  # with the words in the other order
_ORDERS = {"big": "ABCD", "little": "CDAB"}


class Counts:
    """A terminal's numbers in its registers.

    Args:
        terminal: of a description that has its addresses on the wire (`ModbusDescription.on_the_wire`).
        order: of the bytes of more than one register, where the terminal says none.
    """

    def __init__(self, terminal: ModbusTerminal, order: str) -> None:
        form = terminal.type or "u16"
        self.terminal, self.words = terminal, WORDS[form]
        order = terminal.byte_order or (_ORDERS.get(order, order) if self.words > 1 else "AB")
        self._slope, self._offset = terminal.scale
        lowest, width = terminal.field or (0, 1 if form == "bit" else 16 * self.words)
        self._bits, self._swapped = (
            Bits(_places(one, self.words, range(lowest, lowest + width)), form[0] == "s" and width > 1, form[0] == "f")
            for one in (order, _SWAPPED.get(order, order))
        )
        self._none = next(iter(counts_of(terminal.invalid)), 0)

    def encoded(self, value: float, swapped: bool = False, around: Sequence[int] = ()) -> list[int]:
        """The registers of a value, at the end of what they can hold where it is beyond.

        Args:
            value: in the terminal's unit.
            swapped: whether the words of a floating-point number come in the other order.
            around: what else stands in the registers; nothing if not given.
        """
        data = bytearray(_on_the_wire(around or [0] * self.words))
        bits = self._swapped if swapped and self._bits.is_real else self._bits
        bits.put(data, (value - self._offset) / self._slope, self._none)
        return [data[i] << 8 | data[i + 1] for i in range(0, len(data), 2)]

    def decoded(self, words: Sequence[int]) -> float:
        """The value of registers."""
        return self._bits.taken(_on_the_wire(words)) * self._slope + self._offset

    def takes(self, words: Sequence[int]) -> bool:
        """Whether a written count lies within what the description allows."""
        raw, count = self.terminal.raw, self._bits.taken(_on_the_wire(words))
        return raw is None or self._bits.is_real or min(raw) - 0.5 <= count <= max(raw) + 0.5


def _on_the_wire(words: Sequence[int]) -> bytes:
    return struct.pack(f">{len(words)}H", *words)


def _places(order: str, words: int, bits: range) -> tuple[tuple[int, int], ...]:
    """(byte on the wire, bit) of each bit of a number."""
    wire = _EIGHT[order] if words == 4 else tuple("ABCD".index(letter) for letter in order)
    return tuple((wire.index(2 * words - 1 - bit // 8), bit % 8) for bit in bits)
