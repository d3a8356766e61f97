"""Which objects a node's PDOs carry: as its file says, else as it is told over SDO, always read back."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from hil.description.eds import FORMS, Dictionary
from hil.errors import LinkError, SettingError

Place = tuple[int, int]
Upload = Callable[[int, int], int]
Download = Callable[[int, int, int, str], None]
_LONGEST = 8
_NO_PDO = 1 << 31
_FLAGS = 0x60000000  # of an identifier: no remote frames, 29 bits; a node's own, left as they are
_WITH_SYNC = range(1, 241)  # transmission types


@dataclass(frozen=True, slots=True)
class Pdo:
    """One PDO.

    Attributes:
        number: from 0.
        identifier: on the bus.
        places: the objects that it carries, in this order.
        form: of its bytes.
        as_file: whether that is what the file says; else the node is told.
    """

    number: int
    identifier: int
    places: tuple[Place, ...]
    form: str
    as_file: bool

    def values(self, data: bytes) -> dict[Place, float]:
        """What its bytes say.

        Raises:
            LinkError: they are too few.
        """
        if len(data) < struct.calcsize(self.form):
            raise LinkError(
                f"PDO {self.identifier:#05x} has {len(data)} bytes, not {struct.calcsize(self.form)}: another program "
                f"changed its mapping"
            )
        return dict(zip(self.places, struct.unpack(self.form, data[: struct.calcsize(self.form)]), strict=True))

    def packed(self, values: dict[Place, float]) -> bytes:
        """Its bytes."""
        letters = self.form[1:]
        return struct.pack(self.form, *(values[place] if letter == "f" else int(values[place])
                                        for place, letter in zip(self.places, letters, strict=True)))  # fmt: skip


def pdos_for(objects: Dictionary, node: int, places: Sequence[Place], way: Literal["sent", "received"]) -> list[Pdo]:
    """PDOs of a node that carry these objects, and as few others as there are in the file.

    Args:
        objects: its dictionary.
        node: its number.
        places: the objects.
        way: `sent` by the node or `received`. What is received must carry nothing else, or that would be driven too.

    Raises:
        SettingError: they cannot all be mapped.
    """
    if not places:
        return []
    first = 0x1800 if way == "sent" else 0x1400
    there = [i for i in range(512) if (first + i, 1) in objects]
    numbers = [n for n in there if way == "received" or with_sync(objects, first + n)]
    by_file = {n: _mapped(objects, first + 0x200 + n) for n in numbers}
    chosen = [n for n in numbers if any(place in places for place in by_file[n])]
    carried = {place for n in chosen for place in by_file[n]}
    alone = all(place in places for place in carried)
    if set(places) <= carried and (way == "sent" or alone):
        return [Pdo(n, _identifier(objects, first + n, node, way), by_file[n], _form(objects, by_file[n]), True)
                for n in chosen]  # fmt: skip
    return [Pdo(n, _identifier(objects, first + n, node, way), part, _form(objects, part), False)
            for n, part in zip(numbers, _parts(objects, places, len(numbers)), strict=False)]  # fmt: skip


def configure(
    pdos: Iterable[Pdo], way: Literal["sent", "received"], upload: Upload, download: Download, objects: Dictionary
) -> None:
    """Have a node's PDOs carry what they shall, and see that they do.

    Raises:
        LinkError: what is read back is something else.
    """
    for pdo in pdos:
        communication = (0x1800 if way == "sent" else 0x1400) + pdo.number
        mapping = communication + 0x200
        entries, flags = [_entry(objects, place) for place in pdo.places], upload(communication, 1) & _FLAGS
        if [upload(mapping, i + 1) for i in range(min(upload(mapping, 0), 64))] != entries:
            download(communication, 1, flags | pdo.identifier | _NO_PDO, "<I")
            download(mapping, 0, 0, "<B")
            for i, entry in enumerate(entries):
                download(mapping, i + 1, entry, "<I")
            download(mapping, 0, len(entries), "<B")
        if way == "sent" and upload(communication, 2) != 1:
            download(communication, 2, 1, "<B")  # with every SYNC
        if way == "received" and upload(communication, 2) < 254:
            download(communication, 2, 255, "<B")  # at once
        if upload(communication, 1) & ~_FLAGS != pdo.identifier:
            download(communication, 1, flags | pdo.identifier, "<I")
        there = [upload(mapping, i + 1) for i in range(upload(mapping, 0))]
        if there != entries or upload(communication, 1) & 0x800007FF != pdo.identifier:
            found = ", ".join(f"{entry:#010x}" for entry in there)
            raise LinkError(
                f"object {mapping:04X} reads {found or 'nothing'} back, not what it was told: its mapping is fixed"
            )


def with_sync(objects: Dictionary, communication: int) -> bool:
    """Whether a PDO that a node sends comes with SYNC, or can be told to; some come at changes alone."""
    found = objects.get((communication, 2))
    return found is None or found.writable or _default(objects, (communication, 2)) in _WITH_SYNC


def _mapped(objects: Dictionary, mapping: int) -> tuple[Place, ...]:
    """What the file says that a PDO carries."""
    count = _default(objects, (mapping, 0))
    entries = [_default(objects, (mapping, i)) for i in range(1, count + 1)]
    return tuple((entry >> 16, entry >> 8 & 0xFF) for entry in entries if entry)


def _default(objects: Dictionary, place: Place) -> int:
    found = objects.get(place)
    return int((found and found.at_start) or 0)


def _identifier(objects: Dictionary, communication: int, node: int, way: str) -> int:
    """By the file, else of the predefined connection set."""
    number = communication - (0x1800 if way == "sent" else 0x1400)
    base = (0x180 if way == "sent" else 0x200) + 0x100 * (number % 4) + node
    found = objects.get((communication, 1))
    if found is not None and found.at_start is not None:
        identifier = int(found.at_start) & 0x7FF
        return identifier + node if found.is_relative and identifier & 0x7F == 0 else identifier or base
    return base


def _form(objects: Dictionary, places: Iterable[Place]) -> str:
    letters = [FORMS.get(found.data_type) if (found := objects.get(place)) is not None else None for place in places]
    if None in letters:
        raise SettingError(f"a PDO carries objects of which the file says no number of 32 bits at most: {list(places)}")
    return "<" + "".join(letter for letter in letters if letter)


def _entry(objects: Dictionary, place: Place) -> int:
    bits = 8 * struct.calcsize("<" + FORMS[objects[place].data_type])
    return place[0] << 16 | place[1] << 8 | bits


def _parts(objects: Dictionary, places: Sequence[Place], most: int) -> list[tuple[Place, ...]]:
    """Objects in groups of eight bytes."""
    parts: list[list[Place]] = [[]]
    for place in places:
        if struct.calcsize(_form(objects, [*parts[-1], place])) > _LONGEST:
            parts.append([])
        parts[-1].append(place)
    if len(parts) > most:
        raise SettingError(
            f"the node has {most} PDOs for {len(places)} objects, which need {len(parts)}: use fewer of them"
        )
    return [tuple(part) for part in parts]
