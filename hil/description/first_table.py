"""The first description of a device on Modbus, from the register table of its manual."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from hil.description.gaps import GAP, head, number_in, range_line, unique, unit_line
from hil.description.makers_text import makers_text
from hil.description.modbus import WORDS
from hil.description.modbus_place import on_the_wire
from hil.errors import FileError
from hil.untrusted import read_small

_COLUMNS: Mapping[str, tuple[str, ...]] = {
    "name": ("name", "parameter", "description", "signal", "variable", "function", "meaning", "quantity",
             "item"),
    "channel": ("channel", "ch", "ch."), "reference": ("reference", "ref", "ref."),
    "address": ("address", "register", "addr", "modbus address", "register address", "reg", "offset address"),
    "type": ("type", "data type", "datatype", "format"), "unit": ("unit", "units"),
    "scale": ("scale", "factor", "multiplier", "gain", "resolution", "scaling"), "offset": ("offset",),
    "low": ("min", "low", "minimum", "range min", "from"), "high": ("max", "high", "maximum", "range max", "to"),
    "access": ("access", "r/w", "rw", "read/write", "mode", "attribute"),
    "table": ("table", "register type", "object type", "area"),
}  # fmt: skip
_TYPES = (
    (r"f(loat)?64|double|lreal", "f64"), (r"f(loat)?(32)?|real|ieee.*|single", "f32"),
    (r"u(int)?64|qword|ulint", "u64"), (r"s?i?(nt)?64|lint", "s64"), (r"u(int|nsigned)? ?32|dword|udint|ulong", "u32"),
    (r"s?i?(nt)?(eger)? ?32|dint|long|signed ?32", "s32"),
    (r"u(int|nsigned)? ?(16|8)?|word|ushort|unsigned( int)?", "u16"),
    (r"s?i?(nt)?(eger)? ?(16|8)?|short|signed( int)?", "s16"), (r"b(it|ool)(ean)?", "bit"),
)  # fmt: skip
_HERE = "\0"  # a number, in a name that braces are taken from
_WIDEST = 4  # registers of one number
_TABLES = (
    ("holding", "holding"),
    ("input reg", "input"),
    ("coil", "coil"),
    ("discrete", "discrete"),
    ("input", "input"),
)


def from_table(path: Path) -> Iterator[str]:
    """Its lines. Raises `FileError` for what is no table."""
    rows, columns = _table(path)
    if _by_number([a for row in rows if (a := _address(_cell(row, columns, "reference"))) is not None]):
        columns["address"] = columns["reference"]  # it says the table too
    addresses = [_address(row[columns["address"]]) for row in rows]
    by_number = _by_number([a for a in addresses if a is not None])
    yield from head(path, "modbus")
    yield ""
    yield "[modbus]"
    if by_number:
        yield 'addresses = "40001"'
    else:
        lowest = min((a for a in addresses if a is not None), default=0)
        yield f'addresses = "wire"   {GAP} from 0? This table begins at {lowest}; counting from 1 is one too high'
    if any(_type(_cell(row, columns, "type")) not in ("u16", "s16", "bit") for row in rows):
        yield f'byte_order = "ABCD"   {GAP} of numbers in several registers: ABCD, CDAB, BADC or DCBA'
    names: set[str] = set()
    for row, address in zip(rows, addresses, strict=True):
        if address is not None:
            yield from _row(row, columns, address, by_number, names)
        elif cell := row[columns["address"]]:
            yield from ("", f"{GAP} '{_cell(row, columns, 'name')}' is left out: its address {cell} is not understood")
    yield ""
    yield f"{GAP} [watchdog], where it has outputs: how it is armed, and where they go"


def _row(
    row: Sequence[str], columns: Mapping[str, int], address: int, by_number: bool, names: set[str]
) -> Iterator[str]:
    cell, channel = _cell(row, columns, "name") or f"register {address}", _cell(row, columns, "channel")
    form = _type(_cell(row, columns, "type"))
    count = _count(row[columns["address"]], address, form)
    numbered, first = _numbered(cell) if count > 1 else (cell, 0)
    name = unique(f"{numbered} {channel}" if channel else numbered, names).replace(_HERE, "{n}")
    access = _cell(row, columns, "access").lower()
    yield ""
    yield f'[terminals."{name}"]'
    if count > 1:
        yield f"count = {count}"
        yield f"first = {first}"
    writable = f'   {GAP} may be written ({access}): "out" if the bench drives it' if "w" in access else ""
    yield f'direction = "in"{writable}'
    yield unit_line(_cell(row, columns, "unit"), "unit" in columns)
    yield from range_line(_cell(row, columns, "low"), _cell(row, columns, "high"))
    if not by_number:
        cell = _cell(row, columns, "table").lower()
        table = next((found for word, found in _TABLES if word in cell), "")
        yield f'table = "{table}"' if table else f'table = "holding"   {GAP} holding (function 3) or input (4)?'
    yield f"address = {address}"
    line = f'type = "{form or _wide(_cell(row, columns, "type"))}"'
    cell = _cell(row, columns, "type")
    yield line if form else f"{line}   {GAP} the table says {repr(cell) if cell else 'nothing'}"
    scale, cell = number_in(_cell(row, columns, "scale")), _cell(row, columns, "scale")
    if scale is not None:
        yield f"slope = {scale:g}" + ("" if scale < 1 else f"   {GAP} or divide by it?")
    elif cell or "scale" not in columns:
        yield f"slope = 1.0   {GAP} unit per count{f'; the table says {cell}' if cell else ''}"
    if (offset := number_in(_cell(row, columns, "offset"))) is not None:
        yield f"offset = {offset:g}"


def _table(path: Path) -> tuple[list[list[str]], dict[str, int]]:
    """Rows of a table, and which column is which."""
    text = makers_text(read_small(path))
    try:
        dialect: Any = csv.Sniffer().sniff(text[:4096], ",;\t|")
    except csv.Error:
        dialect = csv.excel
    rows = [
        [cell.strip() for cell in row] for row in csv.reader(io.StringIO(text), dialect) if any(map(str.strip, row))
    ]
    for i, row in enumerate(rows):
        columns = _columns(row)
        columns.setdefault("address", columns.get("reference", -1))
        if columns["address"] >= 0 and "name" in columns:
            return [r + [""] * (len(row) - len(r)) for r in rows[i + 1 :]], columns
    known = "; ".join(f"{key}: {', '.join(words[:4])}" for key, words in _COLUMNS.items())
    raise FileError(f"{path}: no heading with a name and an address; columns are known by these words: {known}")


def _columns(row: Sequence[str]) -> dict[str, int]:
    cells = [re.sub(r"[\[(].*", "", cell).strip().lower() for cell in row]
    found: dict[str, int] = {}
    for is_it in (str.__eq__, _begins):  # a heading of one word goes before one that only begins with it
        for key, words in _COLUMNS.items():
            free = [i for i in range(len(cells)) if i not in found.values()]
            at = next((i for word in words for i in free if is_it(cells[i], word)), None)
            if at is not None:
                found.setdefault(key, at)
    return found


def _begins(cell: str, word: str) -> bool:
    return re.match(rf"{re.escape(word)}[ /:]", cell) is not None


def _cell(row: Sequence[str], columns: Mapping[str, int], key: str) -> str:
    return row[columns[key]] if key in columns and columns[key] < len(row) else ""


_NUMBER = r"(0x[0-9A-Fa-f]+|[0-9A-Fa-f]+[hH]|\d+)(?![0-9A-Za-z])"
_TO = r"\s*(?:-|–|—|~|…|\.\.+|to)\s*"


def _address(text: str) -> int | None:
    found = re.match(_NUMBER, text)
    return None if found is None else _number(found[1])


def _count(text: str, address: int, form: str) -> int:
    """How many terminals stand from the first to the last register of a row; registers of one number are one."""
    found = re.match(_NUMBER + _TO + _NUMBER, text)
    registers = _number(found[2]) - address + 1 if found else 1
    words = next((words for name, words in WORDS.items() if name == form), registers if registers <= _WIDEST else 1)
    return max(1, registers // words)


def _numbered(cell: str) -> tuple[str, int]:
    """A name with a place for the number, and the first one: `Channel 1-8 data` is `Channel {n} data` from 1."""
    found = re.search(r"(\d+)" + _TO + r"\d+", cell)
    return (f"{cell[: found.start()]}{_HERE}{cell[found.end() :]}", int(found[1])) if found else (f"{cell} {_HERE}", 1)


def _number(word: str) -> int:
    return int(word[:-1], 16) if word[-1] in "hH" else int(word, 0 if word[:2].lower() == "0x" else 10)


def _by_number(addresses: Sequence[int]) -> bool:
    """Whether every address can be one of a manual with the table in it."""
    try:
        return bool(addresses) and all(a >= 10001 and on_the_wire(a, None, "40001") for a in addresses)
    except ValueError:
        return False


def _type(text: str) -> str:
    word = text.strip().lower().replace("_", "")
    return next((form for pattern, form in _TYPES if word and re.fullmatch(pattern, word)), "")


def _wide(text: str) -> str:
    """A type as wide as a table says that does no more than that."""
    found = re.match(r"([1-4])[ -]?(words?|reg)", text.strip().lower())
    return {"2": "u32", "4": "u64"}.get(found[1], "u16") if found else "u16"
