"""Registers that go in one request: neighbours of one table, and what lies between them where a device allows it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from drivers._registers import Encoding

_MOST_BITS, _MOST_WRITTEN_BITS = 2000, 1968


@dataclass(slots=True)
class RegisterBlock:
    """Registers of one table, by terminal, in the order of their addresses."""

    first: int
    terminals: dict[str, Encoding] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Registers from the first to the last."""
        return max(r.address + r.words for r in self.terminals.values()) - self.first

    @property
    def function(self) -> int:
        """By which they are read."""
        return self._one.function

    @property
    def writing(self) -> int:
        """By which they are written."""
        return self._one.writing

    @property
    def read_back(self) -> int:
        """Where the outputs among them are read back, the first one first."""
        return self._one.read_back_at[1]

    @property
    def read_back_function(self) -> int:
        """By which they are."""
        return self._one.read_back_at[0]

    @property
    def can_be_read(self) -> bool:
        """Whether the outputs among them can be read back."""
        return self._one.can_be_read

    @property
    def has_parts(self) -> bool:
        """Whether registers hold more than the terminals here, which a write must leave as it is."""
        return any(r.terminal.field is not None for r in self.terminals.values())

    def split(self, words: Sequence[int]) -> dict[str, tuple[int, ...]]:
        """The words of each terminal, of those that one request brought."""
        return {name: tuple(words[r.address - self.first :][: r.words]) for name, r in self.terminals.items()}

    def joined(self, words: Mapping[str, Sequence[int]], around: Sequence[int]) -> list[int]:
        """What a request writes: the words of each terminal, and `around` in bits that are nobody's."""
        whole = list(around)
        for name, register in self.terminals.items():
            for i, (word, mask) in enumerate(zip(words[name], register.mask, strict=True)):
                at = register.address - self.first + i
                whole[at] = whole[at] & ~mask & 0xFFFF | word & mask
        return whole

    def takes(self, register: Encoding, gap: int, longest: int) -> bool:
        """Whether a register goes on where these end, also in its read-back."""
        one, last = self._one, self.first + self.count
        alike = (register.table, register.writing, register.can_be_read, register.read_back_at[0]) == (
            one.table, one.writing, one.can_be_read, one.read_back_at[0]
        )  # fmt: skip
        same = register.read_back_at[1] - register.address == one.read_back_at[1] - one.address
        near = self.first <= register.address <= last + gap
        return alike and same and near and max(last, register.address + register.words) - self.first <= longest

    @property
    def _one(self) -> Encoding:
        return next(iter(self.terminals.values()))


def register_blocks(registers: Mapping[str, Encoding], gap: int = 0, longest: int = 125) -> list[RegisterBlock]:
    """Registers in as few requests as possible without asking for more than `gap` between them (some devices refuse).

    Args:
        registers: by terminal.
        gap: so many that nothing is wanted of may be read across.
        longest: registers of one request.
    """
    return _grouped(registers, gap, longest, _MOST_BITS)


def written(registers: Mapping[str, Encoding], longest: int = 123) -> list[RegisterBlock]:
    """Outputs in as few requests as their functions allow, nothing between them."""
    together = _grouped(registers, 0, longest, _MOST_WRITTEN_BITS)
    return [part for block in together for part in _alone(block)]


def _alone(block: RegisterBlock) -> Iterable[RegisterBlock]:
    """Functions 5 and 6 write one at a time; parts of one register stay together."""
    if block.writing not in (5, 6):
        return [block]
    by_address: dict[int, RegisterBlock] = {}
    for name, register in block.terminals.items():
        by_address.setdefault(register.address, RegisterBlock(register.address)).terminals[name] = register
    return by_address.values()


def _grouped(registers: Mapping[str, Encoding], gap: int, longest: int, most_bits: int) -> list[RegisterBlock]:
    found: list[RegisterBlock] = []
    for name, register in sorted(registers.items(), key=lambda item: (item[1].table, item[1].address)):
        most = most_bits if register.is_bit else longest
        if not found or not found[-1].takes(register, gap, most):
            found.append(RegisterBlock(register.address))
        found[-1].terminals[name] = register
    return found
