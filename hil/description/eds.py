"""EDS and DCF files as makers write them (CiA 306): the objects of a node, as data.

Files of the trade have sections twice, keys in other letters, numbers with leading zeros, empty values, records without
their head, and abbreviations. What can be understood is understood; what cannot is left out and said.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from hil.description.makers_text import makers_text

Place = tuple[int, int]
Section = dict[str, str]
FORMS = {0x02: "b", 0x03: "h", 0x04: "i", 0x05: "B", 0x06: "H", 0x07: "I", 0x08: "f"}
"""Data types of four bytes at most, as `struct` writes them."""
_OBJECT = re.compile(r"([0-9a-f]{4})(?:sub([0-9a-f]{1,2})|(name|value))?")
_DOMAIN, _ARRAY, _RECORD = 2, 8, 9
_DOMAIN_TYPE = 0x0F
_REALS = (0x08, 0x11)
_LAST_TYPE = 0x1B
_MOST_MEMBERS = 254
_PDO_WAYS = {0x1400: ("nrofrxpdo", 0x200), 0x1800: ("nroftxpdo", 0x180)}


@dataclass(frozen=True, slots=True)
class Object:
    """A variable of an object dictionary.

    Attributes:
        index, sub: where it stands.
        record: the name of the record or array that it is a member of; empty for one that stands alone.
        name: its own.
        data_type: by CiA 301.
        access: `rw`, `ro`, `wo`, `const` and the like.
        default, value: after power-on by the file, and as a DCF sets it; None where that is not said.
        is_relative: whether the number of the node is added to `default`.
        low, high: of its counts.
        unit, factor: of one count.
    """

    index: int
    sub: int
    record: str
    name: str
    data_type: int
    access: str
    pdo_mappable: bool
    default: float | None
    value: float | None
    is_relative: bool
    low: int | None
    high: int | None
    unit: str
    factor: float

    @property
    def writable(self) -> bool:
        """Whether it may be written."""
        return "w" in self.access

    @property
    def readable(self) -> bool:
        """Whether it may be read."""
        return "r" in self.access or self.access == "const"

    @property
    def at_start(self) -> float | None:
        """What it is when the node starts: as a DCF sets it, else its default."""
        return self.default if self.value is None else self.value


class Dictionary(dict[Place, Object]):
    """The objects of a file by index and sub-index, in their order.

    Attributes:
        node_id: the node that a DCF is for; None in an EDS.
        left_out: what was not understood, in words.
    """

    def __init__(
        self, objects: Iterable[tuple[Place, Object]] = (), node_id: int | None = None, left_out: tuple[str, ...] = ()
    ) -> None:
        super().__init__(objects)
        self.node_id, self.left_out = node_id, left_out


@dataclass(slots=True)
class _Entry:
    """The sections of one index: its head, its members by sub-index, lists of their names and values."""

    head: Section = field(default_factory=dict)
    members: dict[int, Section] = field(default_factory=dict)
    names: Section = field(default_factory=dict)
    values: Section = field(default_factory=dict)


def dictionary_in(data: bytes) -> Dictionary:
    """The objects of an EDS or DCF.

    Args:
        data: the file; UTF-8, or the Windows code page that makers' editors write.

    Raises:
        ValueError: there is no section in it, or no object.
    """
    left_out: list[str] = []
    sections = _sections(makers_text(data), left_out)
    if not sections:
        raise ValueError("no [section] in it")
    entries = _entries(sections)
    _compact_pdos(entries, sections.get("deviceinfo", {}))
    objects = {}
    for index, entry in sorted(entries.items()):
        for sub, section in _variables(index, entry):
            kind = _data_type(section, sections)
            if kind is None:
                left_out.append(f"[{section['section']}] has no DataType")
            else:
                objects[index, sub] = _object(index, sub, section, kind)
    if not objects:
        raise ValueError("no object in it")
    commissioning = sections.get("devicecomissioning") or sections.get("devicecommissioning") or {}
    node = _number(commissioning.get("nodeid", ""))
    return Dictionary(objects.items(), node if node and 1 <= node <= 127 else None, tuple(left_out))


def _sections(text: str, left_out: list[str]) -> dict[str, Section]:
    """Names and keys in small letters. Of what stands twice the first counts, as for the makers' own tools."""
    found: dict[str, Section] = {}
    here: Section | None = None
    for number, line in enumerate(text.splitlines(), start=1):
        stripped = line.strip()
        if not stripped or stripped[0] in ";#/":
            continue
        if stripped[0] == "[":
            here = found.setdefault(stripped[1:].partition("]")[0].strip().lower(), {})
            continue
        key, equals, value = stripped.partition("=")
        if here is None or not equals:
            left_out.append(f"line {number}: no KEY=VALUE")
            continue
        key, value = key.strip(), re.split(r"\s;", value, maxsplit=1)[0].strip()
        if (first := here.setdefault(key.lower(), value)) != value:
            left_out.append(f"line {number}: {key} stands twice, {first!r} counts")
    return found


def _entries(sections: Mapping[str, Section]) -> dict[int, _Entry]:
    """Sections by index. Data types that a mapping may carry as dummies stand at their number (`DummyUsage`)."""
    found: dict[int, _Entry] = {}
    for key, value in sections.get("dummyusage", {}).items():
        kind = key.removeprefix("dummy")
        if kind.isdecimal() and _number(value) == 1:
            found[int(kind)] = _Entry({"parametername": f"Dummy{kind}", "datatype": kind, "accesstype": "const"})
    for name, section in sections.items():
        if (at := _OBJECT.fullmatch(name)) is None:
            continue
        entry = found.setdefault(int(at[1], 16), _Entry())
        if at[2]:
            entry.members[int(at[2], 16)] = section
        else:
            setattr(entry, f"{at[3]}s" if at[3] else "head", section)
    return found


def _compact_pdos(entries: dict[int, _Entry], about: Section) -> None:
    """PDOs without a section of their own (`CompactPDO`), as the predefined connection set has them."""
    if not _number(about.get("compactpdo", "")):
        return
    for first, (count, base) in _PDO_WAYS.items():
        for i in range(min(_number(about.get(count, "")) or 0, 512)):
            identifier = f"$NODEID+{base + 0x100 * i:#x}" if i < 4 else f"{1 << 31:#x}"
            entries.setdefault(first + i, _record("PDO communication", ("5", "2"), ("7", identifier), ("5", "255")))
            entries.setdefault(first + 0x200 + i, _record("PDO mapping", ("5", "0"), *[("7", "")] * 8))


def _record(name: str, *members: tuple[str, str]) -> _Entry:
    return _Entry({"parametername": name}, {
        sub: {"parametername": name, "datatype": kind, "accesstype": "rw", "defaultvalue": value}
        for sub, (kind, value) in enumerate(members)
    })  # fmt: skip


def _variables(index: int, entry: _Entry) -> Iterator[tuple[int, Section]]:
    """Each variable at an index by its sub-index, with the `section` it stands in and the `record` it belongs to."""
    head, members, kind = entry.head, dict(entry.members), _number(entry.head.get("objecttype", ""))
    name = head.get("parametername") or f"object {index:04X}"
    if count := _number(head.get("compactsubobj", "")):  # members that are alike stand in the file as one
        alike = {key: value for key, value in head.items() if key != "objecttype"}
        members.setdefault(0, {"parametername": "Number of entries", "datatype": "5", "defaultvalue": str(count)})
    elif kind == _ARRAY and 1 in members:  # those that the file does not list are as the first
        alike, count = members[1], _number(members.get(0, {}).get("defaultvalue", ""))
    for sub in range(1, min(count or 0, _MOST_MEMBERS) + 1):
        own = {"parametername": entry.names.get(str(sub), f"{name}{sub}")}
        if value := entry.values.get(str(sub)):
            own["parametervalue"] = value
        members[sub] = alike | own | members.get(sub, {})
    for sub, section in sorted(members.items()):
        yield sub, {**section, "section": f"{index:04X}sub{sub:X}", "record": name}
    if head and not members and kind not in (_ARRAY, _RECORD):
        yield 0, {**head, "section": f"{index:04X}", "parametername": name}


def _object(index: int, sub: int, section: Section, kind: int) -> Object:
    default, is_relative = _start(section.get("defaultvalue", ""), kind)
    value, _ = _start(section.get("parametervalue", ""), kind)
    return Object(
        index, sub, section.get("record", ""), section.get("parametername") or section["section"], kind,
        (section.get("accesstype") or "ro").lower(),  # what may be written must be said
        bool(_number(section.get("pdomapping", ""))), default, value, is_relative,
        _limit(section.get("lowlimit", ""), kind), _limit(section.get("highlimit", ""), kind),
        section.get("unit", ""), _real(section.get("factor", "")) or 1.0,
    )  # fmt: skip


def _data_type(section: Section, sections: Mapping[str, Section]) -> int | None:
    """Its data type, for one of the file's own that which it stands for; None where nothing says what it is."""
    kind = _number(section.get("datatype", ""))
    if kind is None:
        return _DOMAIN_TYPE if _number(section.get("objecttype", "")) == _DOMAIN else None
    if kind <= _LAST_TYPE:
        return kind
    return _number(sections.get(f"{kind:x}sub1", {}).get("defaultvalue", "")) or _DOMAIN_TYPE


def _start(text: str, kind: int) -> tuple[float | None, bool]:
    """A sum of numbers and `$NODEID` in any order and letters: without the node's number, and whether that is added."""
    if kind in _REALS:
        return _real(text), False
    parts = text.upper().split("+")
    numbers = [_number(part) for part in parts if part.strip() != "$NODEID"]
    if None in numbers or len(parts) > len(numbers) + 1:
        return None, False
    return sum(number or 0 for number in numbers), len(parts) > len(numbers)


def _limit(text: str, kind: int) -> int | None:
    """A limit of counts; one of signed numbers may be written as their bits."""
    number, form = _number(text), FORMS.get(kind, "")
    bits = 8 * struct.calcsize(form)
    is_negative = number is not None and form in ("b", "h", "i") and number >= 1 << bits - 1
    return number - (1 << bits) if number is not None and is_negative else number


def _real(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _number(text: str) -> int | None:
    """`0x10`, `10h`, `007`, `7`, also with a sign; None for what is none."""
    found = re.fullmatch(r"([+-]?)(?:0[xX]([0-9A-Fa-f]+)|([0-9A-Fa-f]+)[hH]|(\d+))", text.strip())
    if found is None:
        return None
    sign = -1 if found[1] == "-" else 1
    return sign * (int(found[4]) if found[4] else int(found[2] or found[3], 16))
