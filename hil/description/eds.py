"""EDS and DCF files as makers write them, put into the form that the canopen library reads (CiA 306).

Files of the trade have sections twice, keys in other letters, numbers with leading zeros, empty values, records without
their head, and abbreviations that the library passes over. What can be understood is understood; what cannot is left
out and said.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from hil.description.makers_text import makers_text

Section = dict[str, str]
_KEYS = {key.lower(): key for key in (
    "ParameterName", "ObjectType", "DataType", "AccessType", "DefaultValue", "ParameterValue", "PDOMapping", "LowLimit",
    "HighLimit", "SubNumber", "CompactSubObj", "Unit", "Factor", "Description", "NodeID", "NodeName", "Baudrate",
    "VendorName", "VendorNumber", "ProductName", "ProductNumber", "RevisionNumber", "OrderCode", "NrOfRXPDO",
    "NrOfTXPDO", "CompactPDO",
)}  # fmt: skip
_OBJECT = re.compile(r"([0-9A-F]{4})(?:(SUB)([0-9A-F]{1,2})|(NAME|VALUE))?", re.IGNORECASE)
_NUMBERS = ("ObjectType", "DataType", "PDOMapping", "SubNumber", "CompactSubObj", "NodeID")
_VARIABLE, _DOMAIN, _ARRAY, _RECORD = "0x7", "0x2", "0x8", "0x9"
_DOMAIN_TYPE = "0xf"
_LAST_TYPE = 0x1B
_PDO_WAYS = {0x1400: ("NrOfRXPDO", 0x200), 0x1800: ("NrOfTXPDO", 0x180)}


@dataclass(slots=True)
class EdsText:
    """A file in the library's form.

    Attributes:
        text: of it.
        node: the node that a DCF is for; None in an EDS.
        left_out: what was not understood, in words.
    """

    text: str
    node: int | None = None
    left_out: list[str] = field(default_factory=list)


def eds_text(data: bytes) -> EdsText:
    """What stands in an EDS or DCF.

    Args:
        data: the file; UTF-8, or the Windows code page that makers' editors write.

    Raises:
        ValueError: there is no section in it.
    """
    left_out: list[str] = []
    sections = _sections(makers_text(data), left_out)
    if not sections:
        raise ValueError("no [section] in it")
    objects, values = _objects(sections)
    for entry in objects.values():
        _plain_numbers(entry, sections)
    about = sections.get("deviceinfo", {})
    _compact_pdos(objects, about)
    for index in sorted({index for index, _ in objects}):
        _completed(index, objects, values, left_out)
    lines = list(_written("DeviceInfo", _device(about)))
    lines += _written("DummyUsage", _dummies(sections.get("dummyusage", {})))
    for index, sub in sorted(objects, key=lambda place: (place[0], -1 if place[1] is None else place[1])):
        entry = objects[index, sub]
        lines += _written(f"{index:04X}" + ("" if sub is None else f"sub{sub:X}"), entry)
    commissioning = sections.get("devicecomissioning") or sections.get("devicecommissioning") or {}
    node = _number(commissioning.get("NodeID", ""))
    return EdsText("\n".join(lines) + "\n", node if node and 1 <= node <= 127 else None, left_out)


def _sections(text: str, left_out: list[str]) -> dict[str, Section]:
    """By name in small letters. Of what stands twice the first counts, as for the makers' own tools."""
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
        key = _KEYS.get(key.lower(), key)
        if here.setdefault(key, value) != value:
            left_out.append(f"line {number}: {key} stands twice, {here[key]!r} counts")
    return found


Objects = dict[tuple[int, int | None], Section]
Values = dict[int, dict[str, Section]]


def _objects(sections: Mapping[str, Section]) -> tuple[Objects, Values]:
    """Objects by index and sub-index (None for the head), and lists of names and values by index."""
    objects: Objects = {}
    values: Values = {}
    for name, section in sections.items():
        found = _OBJECT.fullmatch(name)
        if found is None:
            continue
        index = int(found[1], 16)
        if found[4]:
            values.setdefault(index, {})[found[4].upper()] = section
        else:
            objects[index, int(found[3], 16) if found[2] else None] = dict(section)
    return objects, values


def _compact_pdos(objects: Objects, about: Section) -> None:
    """PDOs without a section of their own (`CompactPDO`), as the predefined connection set has them."""
    if not _number(about.get("CompactPDO", "")):
        return
    for first, (count, base) in _PDO_WAYS.items():
        for i in range(min(_number(about.get(count, "")) or 0, 512)):
            identifier = f"$NODEID+{base + 0x100 * i:#x}" if i < 4 else f"{1 << 31:#x}"
            _record(objects, first + i, "PDO communication", [("0x7", identifier), ("0x5", "255")])
            _record(objects, first + 0x200 + i, "PDO mapping", [("0x7", "")] * 8, count="0")


def _record(objects: Objects, index: int, name: str, members: list[tuple[str, str]], count: str = "") -> None:
    if (index, None) in objects:
        return
    objects[index, None] = {"ParameterName": name, "ObjectType": _RECORD}
    entries = [("0x5", count or str(len(members))), *members]
    for sub, (kind, value) in enumerate(entries):
        access = "rw" if sub or count else "ro"
        objects[index, sub] = {"ParameterName": name, "ObjectType": _VARIABLE, "DataType": kind, "AccessType": access,
                               **({"DefaultValue": value} if value else {})}  # fmt: skip


def _completed(index: int, objects: Objects, values: Values, left_out: list[str]) -> None:
    """An object as the library wants it: a head before its members, each with name, type and access."""
    members = [sub for at, sub in objects if at == index and sub is not None]
    head = objects.setdefault((index, None), {"ObjectType": _RECORD})
    head.setdefault("ParameterName", f"object {index:04X}")
    if "CompactSubObj" in head:
        _expanded(index, objects, values.get(index, {}))
    elif members:
        if head.get("ObjectType") not in (_ARRAY, _RECORD):
            head["ObjectType"] = _RECORD
        for sub in members:
            _entry(objects, (index, sub), f"{index:04X}sub{sub:X}", left_out)
    elif head.get("ObjectType") not in (_ARRAY, _RECORD):
        _entry(objects, (index, None), f"{index:04X}", left_out)


def _expanded(index: int, objects: Objects, listed: Mapping[str, Section]) -> None:
    """An array whose members are alike, and stand in the file as one (`CompactSubObj`)."""
    head = objects[index, None]
    count = min(_number(head.pop("CompactSubObj")) or 0, 254)
    alike = {key: value for key, value in head.items() if key not in ("ObjectType", "SubNumber")}
    name = head["ParameterName"]
    objects[index, None] = {"ParameterName": name, "ObjectType": _ARRAY}
    objects.setdefault((index, 0), {"ParameterName": "Number of entries", "ObjectType": _VARIABLE, "DataType": "0x5",
                                    "AccessType": "ro", "DefaultValue": str(count)})  # fmt: skip
    for sub in range(1, count + 1):
        called = listed.get("NAME", {}).get(str(sub), f"{name}{sub}")
        own = alike | {"ObjectType": _VARIABLE, "ParameterName": called}
        if value := listed.get("VALUE", {}).get(str(sub)):
            own["ParameterValue"] = value
        entry = objects.setdefault((index, sub), {})
        objects[index, sub] = own | entry
        _entry(objects, (index, sub), "", [])


def _entry(objects: Objects, place: tuple[int, int | None], section: str, left_out: list[str]) -> None:
    """A variable with all that the library asks for; taken away where nothing says what it is."""
    entry = objects[place]
    entry.setdefault("ParameterName", section)
    if entry.get("ObjectType") == _DOMAIN:
        entry.setdefault("DataType", _DOMAIN_TYPE)
    if "DataType" not in entry:
        del objects[place]
        left_out.append(f"[{section}] has no DataType")
        return
    entry["AccessType"] = entry.get("AccessType") or "ro"  # what may be written must be said


def _plain_numbers(entry: Section, sections: Mapping[str, Section]) -> None:
    """Numbers in one way of writing, and a type of the file's own as the one that it stands for."""
    for key in _NUMBERS:
        if key in entry:
            number = _number(entry[key])
            if number is None:
                del entry[key]
            else:
                entry[key] = f"{number:#x}"
    for key in ("DefaultValue", "ParameterValue"):
        if key in entry and (total := _total(entry[key])):
            entry[key] = total
    kind = int(entry.get("DataType", "0"), 16)
    if kind > _LAST_TYPE:
        stands_for = _number(sections.get(f"{kind:x}sub1", {}).get("DefaultValue", ""))
        entry["DataType"] = f"{stands_for:#x}" if stands_for else _DOMAIN_TYPE


def _number(text: str) -> int | None:
    """`0x10`, `10h`, `007`, `7`, also with a sign; None for what is none."""
    found = re.fullmatch(r"([+-]?)(?:0[xX]([0-9A-Fa-f]+)|([0-9A-Fa-f]+)[hH]|(\d+))", text.strip())
    if found is None:
        return None
    sign = -1 if found[1] == "-" else 1
    return sign * (int(found[4]) if found[4] else int(found[2] or found[3], 16))


def _total(text: str) -> str:
    """A sum of numbers and `$NODEID` in any order and letters as `$NODEID+0x180`; empty for anything else."""
    parts = [part.strip() for part in text.split("+")]
    relative = [part for part in parts if part.upper() == "$NODEID"]
    numbers = [_number(part) for part in parts if part.upper() != "$NODEID"]
    if len(relative) > 1 or any(number is None for number in numbers):
        return ""
    total = sum(number for number in numbers if number is not None)
    if relative:
        return f"$NODEID+{total:#x}"
    is_plain = len(parts) == 1 and text.isdecimal() and text[0] != "0"
    return text if is_plain else f"{total:#x}"


def _device(about: Section) -> Section:
    names = {key: value for key, value in about.items() if key in ("VendorName", "ProductName", "OrderCode")}
    numbers = {key: _number(value) for key, value in about.items()
               if key in ("VendorNumber", "ProductNumber", "RevisionNumber", "NrOfRXPDO", "NrOfTXPDO")}  # fmt: skip
    return names | {key: f"{number:#x}" for key, number in numbers.items() if number is not None}


def _dummies(section: Section) -> Section:
    by_name = {key.lower(): value for key, value in section.items()}
    return {f"Dummy{i:04d}": str(int(_number(by_name.get(f"dummy{i:04d}", "")) == 1)) for i in range(1, 8)}


def _written(name: str, section: Section) -> Iterator[str]:
    yield f"[{name}]"
    yield from (f"{key}={value}" for key, value in section.items())
