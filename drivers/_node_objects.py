"""Objects of a node as numbers, in the types that its file says; asked and written over SDO."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping

from drivers._part import Part
from drivers._sdo import Sdo
from hil.description.canopen import CanopenTerminal
from hil.description.eds import FORMS, Dictionary
from hil.errors import DeviceLostError, LinkError


class NodeObjects:
    """The object dictionary of a node on its bus.

    Args:
        sdo: its server.
        file: the objects of its EDS or DCF; none where there is none, and numbers have a form of their own.
        address: of the bus, for errors.
    """

    def __init__(self, sdo: Sdo, file: Dictionary, address: str) -> None:
        self._sdo, self._file, self._address = sdo, file, address

    def recognised(self) -> str:
        """What it says of itself.

        Raises:
            LinkError: another device than its file says.
        """
        kind = self.kind()
        expected = self._by_file(0x1000, 0)
        if expected and kind != expected:
            raise LinkError(
                f"node {self._sdo.node} says that it is of device type {kind:#010x}, its file {expected:#010x}"
            )
        parts = []
        for sub, what, number in self.identity():
            by_file = self._by_file(0x1018, sub)
            if sub <= 2 and by_file and number != by_file:
                raise LinkError(
                    f"node {self._sdo.node} is of {what} {number:#x}; its file is that of {what} {by_file:#x}"
                )
            parts.append(f"{what} {number:#x}")
        return f"node {self._sdo.node}, {', '.join(parts)}" if parts else ""

    def identity(self) -> Iterator[tuple[int, str, int]]:
        """Its identity object (1018), as far as it has that: sub-index, what it says, and the number."""
        for sub, what in enumerate(("vendor", "product", "revision", "serial"), start=1):
            if self._file and (0x1018, sub) not in self._file:
                continue
            try:
                yield sub, what, self.upload(0x1018, sub)
            except LinkError:
                if self._file:
                    raise
                return  # most of the object is optional

    def _by_file(self, index: int, sub: int) -> int:
        found = self._file.get((index, sub))
        return int((found and found.default) or 0)

    def kind(self) -> int:
        """Its device type; raises `DeviceLostError` where nobody answers."""
        import canopen

        try:
            return self.upload(0x1000, 0)
        except canopen.SdoCommunicationError:
            raise DeviceLostError(f"node {self._sdo.node} on {self._address} does not answer") from None

    def counted(self, terminal: CanopenTerminal, value: float) -> float:
        """A value as the terminal's object, or its part of it, takes it; where it is beyond, the end."""
        number, form = terminal.raw_at(value), self.form(terminal.place)[1:]
        if form == "f":
            return number
        return self._part(terminal).nearest(number)

    def part(self, terminal: CanopenTerminal, count: float) -> float:
        """The terminal's number in what its object says."""
        return count if terminal.field is None else self._part(terminal).of(int(count))

    def with_part(self, terminal: CanopenTerminal, count: float, part: float) -> float:
        """What its object says with another number in the terminal's part, the rest as it is."""
        if terminal.field is None:
            return part
        return self._whole(terminal).of(self._part(terminal).put(int(part), int(count)))

    def value(self, terminal: CanopenTerminal, count: float) -> float:
        """The terminal's value by what its object says."""
        return float(terminal.value_at(self.part(terminal, count)))

    def count(self, place: tuple[int, int]) -> float:
        """The number in an object; raises `LinkError` for one of another length than its file says."""
        form, data = self.form(place), self._sdo.transfer("upload", *place)
        if len(data) != struct.calcsize(form):
            raise LinkError(
                f"object {place[0]:04X}.{place[1]} has {len(data)} bytes, its file says {struct.calcsize(form)}"
            )
        (count,) = struct.unpack(form, data)
        return float(count) if form == "<f" else int(count)

    def why_none(self, terminal: CanopenTerminal, counts: Mapping[tuple[int, int], float]) -> str:
        """Why what an input's object says is no measurement, in words; empty where it is one."""
        count = self.part(terminal, counts[terminal.place])
        if why := self._part(terminal).why_none(count, terminal.invalid) or "not a number" * math.isnan(count):
            return why
        flags = (flag for flag in terminal.status if flag.is_so(int(counts[flag.place])))
        return next((flag.means or f"object {flag.object} says so" for flag in flags), "")

    def upload(self, index: int, sub: int) -> int:
        """A whole number that is not negative."""
        return int.from_bytes(self._sdo.transfer("upload", index, sub), "little")

    def signed(self, index: int, sub: int) -> int:
        """A whole number."""
        return int.from_bytes(self._sdo.transfer("upload", index, sub), "little", signed=True)

    def download(self, index: int, sub: int, value: float, form: str) -> None:
        """Write a number in this form."""
        self._sdo.transfer("download", index, sub, struct.pack(form, value if form == "<f" else int(value)))

    def write(self, place: tuple[int, int], value: float) -> None:
        """Write a number in the type of its object."""
        self.download(*place, value, self.form(place))

    def form(self, place: tuple[int, int]) -> str:
        """Of an object's bytes, as `struct` writes it."""
        return "<" + FORMS[self._file[place].data_type]

    def _whole(self, terminal: CanopenTerminal) -> Part:
        form = self.form(terminal.place)
        return Part(0, 8 * struct.calcsize(form), form[1:].islower())

    def _part(self, terminal: CanopenTerminal) -> Part:
        whole = self._whole(terminal)
        return whole if terminal.field is None else Part(*terminal.field, whole.is_signed)
