"""The first description of a device, from the table, EDS or DBC of its maker, with every gap marked."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from hil.description.can import database
from hil.description.canopen import FORMS, dictionary
from hil.description.modbus_place import on_the_wire
from hil.errors import FileError, SettingError, UnitError
from hil.units import check_unit

GAP = "# GAP:"
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
_TABLES = (
    ("holding", "holding"),
    ("input reg", "input"),
    ("coil", "coil"),
    ("discrete", "discrete"),
    ("input", "input"),
)
_NONE = re.compile(
    r"(?<![a-z])(sna|n\.?/?a|not?[ _]?(avail|valid|used|defined)|unavail|invalid|undef|error|err|fault|init)",
    re.IGNORECASE,
)
_SAME_UNITS = {"°c": "degC", "c": "degC", "°": "deg", "rpm": "1/min", "": "1", "-": "1", "none": "1", "lpm": "l/min"}


def first_description(path: Path) -> str:
    """The text of a first description; what the file does not say stands in it as a gap.

    Raises:
        FileError: the file cannot be read as what it is.
        SettingError: it is of another kind.
    """
    made = {".csv": _from_table, ".tsv": _from_table, ".txt": _from_table, ".eds": _from_eds, ".dcf": _from_eds,
            ".dbc": _from_dbc}.get(path.suffix.lower())  # fmt: skip
    if made is None:
        raise SettingError(f"{path}: a register table (.csv), an EDS or DCF (.eds, .dcf) or a DBC file (.dbc) is read")
    if not path.is_file():
        raise FileError(f"{path}: no such file")
    return "\n".join(made(path)).rstrip() + "\n"


def gaps(text: str) -> int:
    """How many gaps a description still has."""
    return text.count(GAP)


def _head(path: Path, protocol: str) -> Iterator[str]:
    yield f"# From {path.name}. Fill in every gap and take its mark away, and what the bench does not need;"
    yield "# `hil describe` checks it."
    yield f'protocol = "{protocol}"'
    yield f'summary = "{path.stem}"   {GAP} what it is, in one line'
    yield f'source = "{path.name}"   {GAP} the manual and its edition'


def _from_table(path: Path) -> Iterator[str]:
    rows, columns = _table(path)
    if _by_number([a for row in rows if (a := _address(_cell(row, columns, "reference"))) is not None]):
        columns["address"] = columns["reference"]  # it says the table too
    addresses = [_address(row[columns["address"]]) for row in rows]
    by_number = _by_number([a for a in addresses if a is not None])
    yield from _head(path, "modbus")
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
    yield ""
    yield f"{GAP} [watchdog], where it has outputs: how it is armed, and where they go"


def _row(
    row: Sequence[str], columns: Mapping[str, int], address: int, by_number: bool, names: set[str]
) -> Iterator[str]:
    said, channel = _cell(row, columns, "name") or f"register {address}", _cell(row, columns, "channel")
    name = _unique(f"{said} {channel}" if channel else said, names)
    access = _cell(row, columns, "access").lower()
    yield ""
    yield f'[terminals."{name}"]'
    writable = f'   {GAP} may be written ({access}): "out" if the bench drives it' if "w" in access else ""
    yield f'direction = "in"{writable}'
    yield _unit_line(_cell(row, columns, "unit"), "unit" in columns)
    yield from _range(_cell(row, columns, "low"), _cell(row, columns, "high"))
    if not by_number:
        said = _cell(row, columns, "table").lower()
        table = next((found for word, found in _TABLES if word in said), "")
        yield f'table = "{table}"' if table else f'table = "holding"   {GAP} holding (function 3) or input (4)?'
    yield f"address = {address}"
    form = _type(_cell(row, columns, "type"))
    told = f'type = "{form or _wide(_cell(row, columns, "type"))}"'
    said = _cell(row, columns, "type")
    yield told if form else f"{told}   {GAP} the table says {repr(said) if said else 'nothing'}"
    scale, said = _number(_cell(row, columns, "scale")), _cell(row, columns, "scale")
    if scale is not None:
        yield f"slope = {scale:g}" + ("" if scale < 1 else f"   {GAP} or divide by it?")
    elif said or "scale" not in columns:
        yield f"slope = 1.0   {GAP} unit per count{f'; the table says {said}' if said else ''}"
    if (offset := _number(_cell(row, columns, "offset"))) is not None:
        yield f"offset = {offset:g}"


def _from_eds(path: Path) -> Iterator[str]:
    objects = dictionary(str(path))
    yield from _head(path, "canopen")
    yield f'eds = "{path.name}"'
    yield from (f"# not understood: {text}" for text in objects.left_out)
    own = [(entry, found) for entry in objects.values() for found in _variables(entry)
           if found.index >= 0x2000 and (found.subindex > 0 or found is entry)]  # fmt: skip
    yield from (f"# {_called(entry, found)}: data type {found.data_type:#04x}, which is not read"
                for entry, found in own if found.pdo_mappable and found.data_type not in FORMS)  # fmt: skip
    numbers = [(entry, found) for entry, found in own if found.data_type in FORMS]
    mapped = [(entry, found) for entry, found in numbers if found.pdo_mappable]
    if not numbers:
        raise FileError(
            f"{path}: no object with a number beyond those of communication, so there is nothing to describe"
        )
    if not mapped:
        yield "# None of its objects can be in a PDO: a node of which inputs alone are used is asked for them."
    elif more := len(numbers) - len(mapped):
        are = "object is" if more == 1 else "objects are"
        yield f"# {more} more {are} in no PDO; a node of which inputs alone are used is asked for those too."
    names: set[str] = set()
    for entry, found in mapped or numbers:
        yield from _object(entry, found, names)
    yield ""
    if 0x1016 in objects:
        yield f"{GAP} [watchdog] expires_to = …, where it has outputs: where they go when it misses our heartbeat"


def _variables(entry: Any) -> list[Any]:
    return [entry[sub] for sub in sorted(entry)] if hasattr(entry, "subindices") else [entry]


def _called(entry: Any, found: Any) -> str:
    return f"{found.index:04X}.{found.subindex} {found.name if found is entry else f'{entry.name}, {found.name}'}"


def _object(entry: Any, found: Any, names: set[str]) -> Iterator[str]:
    own = entry.name if found is entry or found.name.startswith(entry.name) else f"{entry.name} {found.name}"
    yield ""
    yield f'[terminals."{_unique(own if found is entry else f"{own} {found.subindex}", names)}"]'
    out = found.writable
    yield f'direction = "{"out" if out else "in"}"' + (
        f'   {GAP} may be written: "in" if the bench only reads it' if out else ""
    )
    yield _unit_line(found.unit or "", bool(found.unit), "file")
    slope = found.factor if found.factor != 1 else 1.0
    low, high = (None if limit is None else f"{slope * limit:g}" for limit in (found.min, found.max))
    for line in _range(low or "", high or ""):
        yield line if GAP in line else f"{line}   {GAP} the limits of its counts: in the unit"
    yield f'object = "{found.index:04X}.{found.subindex}"'
    yield f"slope = {slope:g}   {GAP} unit per count"


def _from_dbc(path: Path) -> Iterator[str]:
    found = database(str(path))
    if not any(message.signals for message in found.messages):
        raise FileError(f"{path}: no message with a signal in it, so there is nothing to describe")
    yield from _head(path, "can")
    yield f'dbc = "{path.name}"'
    yield from (f"# not as it stands: {text}" for text in found.left_out)
    if any(message.is_extended_frame for message in found.messages):
        yield f"# j1939 = {{ device = 0x00, source = 0x26 }}   {GAP} is this J1939? Then whose messages are believed?"
    for message in found.messages:
        yield ""
        yield f'[messages."{message.name}"]   # sent by {", ".join(message.senders) or "nobody that the file names"}'
        cycle_s = (message.cycle_time or 0) / 1000.0
        yield f"every_s = {cycle_s:g}" if cycle_s else f"# every_s = 0.1   {GAP} how often it is sent"
        yield f"timeout_s = {3.0 * cycle_s or 0.5:g}" + ("" if cycle_s else f"   {GAP} when it counts as none")
        yield f'{GAP} counter = "…", checksum = {{ signal = "…", kind = "…" }}, where it has them'
        selectors = ", ".join(f"{signal.name} = 0" for signal in message.signals if signal.is_multiplexer)
        if selectors:
            yield f"# values = {{ {selectors} }}   {GAP} where the bench sends it: which of its pages"
    names: set[str] = set()
    for message in found.messages:
        for signal in message.signals:
            if signal.is_multiplexer:
                continue
            yield ""
            yield f'[terminals."{_unique(signal.name, names, message.name)}"]'
            yield f'direction = "in"   {GAP} "out" if the bench sends {message.name}'
            yield _unit_line(signal.unit or "", True)
            yield from _range(*("" if limit is None else f"{limit:g}" for limit in (signal.minimum, signal.maximum)))
            yield f'message = "{message.name}"'
            yield f'signal = "{signal.name}"'
            yield from _none_by_name(signal)
    yield ""
    yield f"{GAP} [watchdog] time_s, expires_to, where the bench sends commands: where outputs go when these end"


def _none_by_name(signal: Any) -> Iterator[str]:
    """Counts of a quantity whose names say that they are no measurement; of a state every count has a name."""
    names = {count: str(said) for count, said in (signal.choices or {}).items()}
    none = {count: said for count, said in names.items() if _NONE.search(said)}
    if none:
        told = ", ".join(f'"{count}" = {json.dumps(said)}' for count, said in none.items())
        is_quantity = signal.length >= 8 and len(names) <= 8
        yield f"{'' if is_quantity else '# '}invalid = {{ {told} }}   {GAP} by their names: are they no measurement?"


def _table(path: Path) -> tuple[list[list[str]], dict[str, int]]:
    """Rows of a table, and which column is which."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        text = path.read_text(encoding="latin-1")
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
    said = [re.sub(r"[\[(].*", "", cell).strip().lower() for cell in row]
    found: dict[str, int] = {}
    for is_it in (str.__eq__, _begins):  # a heading of one word goes before one that only begins with it
        for key, words in _COLUMNS.items():
            free = [i for i in range(len(said)) if i not in found.values()]
            at = next((i for word in words for i in free if is_it(said[i], word)), None)
            if at is not None:
                found.setdefault(key, at)
    return found


def _begins(cell: str, word: str) -> bool:
    return re.match(rf"{re.escape(word)}[ /:]", cell) is not None


def _cell(row: Sequence[str], columns: Mapping[str, int], key: str) -> str:
    return row[columns[key]] if key in columns and columns[key] < len(row) else ""


def _address(text: str) -> int | None:
    found = re.match(r"(0x[0-9A-Fa-f]+|[0-9A-Fa-f]+[hH]\b|\d+)", text)
    if found is None:
        return None
    word = found[1]
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


def _number(text: str) -> float | None:
    """A factor: `0.1`, `1/10`, `x0.1`."""
    found = re.fullmatch(r"[x×*]?\s*(-?[\d.]+)(?:\s*/\s*(\d+))?", text.replace(",", "."))
    try:
        return float(found[1]) / float(found[2] or 1) if found else None
    except (ValueError, ZeroDivisionError):
        return None


def _range(low: str, high: str) -> Iterator[str]:
    ends = _number(low), _number(high)
    if ends[0] is not None and ends[1] is not None and ends[0] < ends[1]:
        yield f"range = [{ends[0]:g}, {ends[1]:g}]"
    else:
        yield f"# range = [0, 0]   {GAP} lowest and highest value, in the unit"


def _unit_line(said: str, there: bool, where: str = "table") -> str:
    unit = _SAME_UNITS.get(said.lower(), said)
    try:
        check_unit(unit)
    except UnitError:
        return f'unit = "1"   {GAP} {said!r} is no unit that is known here'
    return f'unit = "{unit}"' if there else f'unit = "1"   {GAP} the {where} says none'


def _unique(name: str, taken: set[str], more: str = "") -> str:
    plain = " ".join(name.replace('"', "").replace("{", "").replace("}", "").split())
    if plain in taken and more:
        plain = f"{more} {plain}"
    number, free = 2, plain
    while free in taken:
        free, number = f"{plain} {number}", number + 1
    taken.add(free)
    return free
