"""A CANopen node in words: which objects of its EDS or DCF are terminals."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Literal, Self

from pydantic import FiniteFloat, field_validator

from hil.bench.lines import Place
from hil.description.eds import FORMS, Dictionary, Object, dictionary_in
from hil.description.makers_text import makers_file
from hil.description.terminal import DescribedDevice, Flagged, PartTerminal
from hil.errors import FileError
from hil.strict import Strict

_OBJECT = re.compile(r"(?:0x)?([0-9A-Fa-f]{4})(?:\.([0-9]{1,3}))?")


def place_of(text: str) -> tuple[int, int]:
    """Index and sub-index of `6130.1` or `0x6130`."""
    found = _OBJECT.fullmatch(text)
    if found is None:
        raise ValueError(f"'{text}' is no object: an index of four hexadecimal digits and a sub-index, such as 6130.1")
    return int(found[1], 16), int(found[2] or 0)


class InObject(Strict):
    """What stands in an object: index and sub-index, `6130.1`; the index alone is sub-index 0."""

    object: str

    @field_validator("object")
    @classmethod
    def _is_object(cls, given: str) -> str:
        place_of(given)
        return given

    @property
    def place(self) -> tuple[int, int]:
        """Index and sub-index."""
        return place_of(self.object)


class ObjectValue(InObject):
    """What is written to an object at opening."""

    value: int | float


class ObjectFlag(InObject, Flagged):
    """A flag in an object."""


class CanopenTerminal(InObject, PartTerminal):
    """A terminal in an object: value = slope · (what the object says) + offset; floats and whole numbers.

    Attributes:
        bit, bits: in a row each terminal stands next to the one before it.
        status: flags that say that it is none.
    """

    status: tuple[ObjectFlag, ...] = ()

    def of_row(self, i: int) -> Self:
        """The terminal `i` of a row, from 0, by itself."""
        bit, bits = self.bit, self.bits
        if bit is not None:
            bit += i
        elif bits is not None:
            on = i * (bits[1] - bits[0] + 1)
            bits = bits[0] + on, bits[1] + on
        return super().of_row(i).model_copy(update={"bit": bit, "bits": bits})


class NodeWatchdog(Strict):
    """Outputs go to `expires_to` when the node misses our heartbeat (object 1016)."""

    expires_to: FiniteFloat


class CanopenDescription(DescribedDevice[CanopenTerminal]):
    """A node on CANopen.

    Attributes:
        eds: the maker's EDS or DCF, beside this file.
        setup: objects that are written at opening with outputs, in this order.
    """

    protocol: Literal["canopen"]
    eds: str
    setup: tuple[ObjectValue, ...] = ()
    watchdog: NodeWatchdog | None = None

    @property
    def dictionary(self) -> Dictionary:
        """The objects of the file. Raises `FileError`."""
        return dictionary(self.eds)


dictionary = makers_file("an EDS or DCF", dictionary_in)
"""The objects of an EDS or DCF, by the path of the file; raises `FileError`."""


def canopen_faults(description: CanopenDescription) -> Iterator[tuple[Place, str]]:
    """Every fault with its place in the file; the text says what is allowed."""
    try:
        objects = description.dictionary
    except FileError as error:
        yield ("eds",), str(error)
        return
    for name, terminal in description.terminals.items():
        found = objects.get(terminal.place)
        yield from ((("terminals", name, "object"), text) for text in _object(found, terminal))
        yield from ((("terminals", name, key), text) for key, text in _part(found, terminal))
        for i, flag in enumerate(terminal.status):
            found = objects.get(flag.place)
            yield from ((("terminals", name, "status", i, "object"), text) for text in _flag(found, flag))
        if terminal.direction == "out" and (terminal.invalid or terminal.status):
            yield ("terminals", name), "invalid and status belong to an input; take them away"
        if terminal.count > 1 and terminal.field is None:
            yield ("terminals", name, "count"), "a row stands in the bits of one object; describe each object"
    yield from _overlaps(description)
    for i, value in enumerate(description.setup):
        if (found := objects.get(value.place)) is None or not found.writable:
            yield (
                ("setup", i, "object"),
                f"{value.object}: no object of {Path(description.eds).name} that can be written",
            )
    if description.watchdog is not None and objects.get((0x1016, 1)) is None:
        yield ("watchdog",), "the file has no object 1016.1: the node watches no heartbeat; take this away"


def _object(found: Object | None, terminal: CanopenTerminal) -> Iterator[str]:
    if found is None:
        yield f"{terminal.object} is not in the file"
    elif found.data_type not in FORMS:
        yield f"{terminal.object} is of data type {found.data_type:#04x}; numbers of 8 to 32 bits and REAL32 are read"
    elif terminal.direction == "out" and not found.writable:
        yield f"{terminal.object} can only be read"
    elif terminal.direction == "in" and not found.readable:
        yield f"{terminal.object} can only be written"


def _part(found: Object | None, terminal: CanopenTerminal) -> Iterator[tuple[str, str]]:
    form = FORMS.get(found.data_type) if found is not None else None
    if terminal.field is None or form is None:
        return
    key, (lowest, width), bits = (
        "bit" if terminal.bit is not None else "bits",
        terminal.field,
        8 * struct.calcsize(form),
    )
    if form == "f":
        yield key, f"a part of a whole number; {terminal.object} is a REAL32"
    elif width < 1 or lowest < 0 or lowest + terminal.count * width > bits:
        yield key, f"{terminal.object} has the bits 0 … {bits - 1}, the lowest first" + (
            f"; this row of {terminal.count} would end at {lowest + terminal.count * width - 1}"
            if terminal.count > 1 else ""
        )  # fmt: skip
    if terminal.direction == "out" and found is not None and not found.readable:
        yield key, f"{terminal.object} can only be written: a part of it goes with the rest, which must be read"


def _overlaps(description: CanopenDescription) -> Iterator[tuple[Place, str]]:
    """Two outputs in one bit: the one would drive the other."""
    taken: dict[tuple[tuple[int, int], int], str] = {}
    for name, terminal in description.terminals.items():
        if terminal.direction != "out":
            continue
        lowest, width = terminal.field or (0, 32)
        for bit in range(lowest, min(lowest + terminal.count * width, 32)):
            other = taken.setdefault((terminal.place, bit), name)
            if other != name:
                where = f"bit {bit} of {terminal.object}" if terminal.field else terminal.object
                yield ("terminals", name, "object"), f"'{other}' is driven by {where} already"
                break


def _flag(found: Object | None, flag: ObjectFlag) -> Iterator[str]:
    form = FORMS.get(found.data_type, "f") if found is not None else "f"
    if found is None:
        yield f"{flag.object} is not in the file"
    elif form == "f" or not found.readable:
        yield f"{flag.object} is no whole number of 8 to 32 bits that can be read"
    elif flag.highest_bit >= (bits := 8 * struct.calcsize(form)):
        yield f"{flag.object} has the bits 0 … {bits - 1}"
