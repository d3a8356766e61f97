"""The first description of a CANopen node, from its EDS or DCF."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from hil.description.canopen import dictionary
from hil.description.eds import FORMS, Dictionary, Object
from hil.description.gaps import GAP, head, range_line, unique, unit_line
from hil.errors import FileError

_MODULE = 401
_LINES = {0x6000: 8, 0x6100: 16, 0x6120: 32, 0x6200: 8, 0x6300: 16, 0x6320: 32}
"""Of the profile's objects that hold digital inputs and outputs, by index."""


def from_eds(path: Path) -> Iterator[str]:
    """Its lines. Raises `FileError` for what is no EDS, or one without a number."""
    objects = dictionary(str(path))
    yield from head(path, "canopen")
    yield f'eds = "{path.name}"'
    yield from (f"# not understood: {text}" for text in objects.left_out)
    own = [found for found in objects.values() if found.index >= 0x2000 and (found.sub > 0 or not found.record)]
    yield from (f"# {_called(found)}: data type {found.data_type:#04x}, which is not read"
                for found in own if found.pdo_mappable and found.data_type not in FORMS)  # fmt: skip
    numbers = [found for found in own if found.data_type in FORMS]
    mapped = [found for found in numbers if found.pdo_mappable]
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
    for found in mapped or numbers:
        lines = _of_lines(found, objects)
        yield from _lines(found, lines, names) if lines else _object(found, names)
    yield ""
    if (0x1016, 1) in objects:
        yield f"{GAP} [watchdog] expires_to = …, where it has outputs: where they go when it misses our heartbeat"


def _of_lines(found: Object, objects: Dictionary) -> int:
    """How many lines an object of an I/O module (CiA 401) has, each a bit of it; 0 for any other object."""
    kind = objects.get((0x1000, 0))
    is_module = kind is not None and int(kind.default or 0) & 0xFFFF == _MODULE
    return _LINES.get(found.index, 0) if is_module else 0


def _lines(found: Object, lines: int, names: set[str]) -> Iterator[str]:
    way = "out" if found.writable else "in"
    yield ""
    yield f'[terminals."{unique(f"d{way[0]}{found.sub}", names)}.{{n}}"]'
    yield f"count = {lines}   {GAP} so many lines does the module have here"
    yield "first = 1"
    yield f'direction = "{way}"'
    yield "range = [0.0, 1.0]"
    yield f'object = "{found.index:04X}.{found.sub}"'
    yield "bit = 0"


def _called(found: Object) -> str:
    return f"{found.index:04X}.{found.sub} {f'{found.record}, ' if found.record else ''}{found.name}"


def _object(found: Object, names: set[str]) -> Iterator[str]:
    own = found.record if found.name.startswith(found.record) else f"{found.record} {found.name}"
    yield ""
    yield f'[terminals."{unique(f"{own} {found.sub}" if found.record else found.name, names)}"]'
    out = found.writable
    yield f'direction = "{"out" if out else "in"}"' + (
        f'   {GAP} may be written: "in" if the bench only reads it' if out else ""
    )
    yield unit_line(found.unit, bool(found.unit), "file")
    low, high = ("" if limit is None else f"{found.factor * limit:g}" for limit in (found.low, found.high))
    for line in range_line(low, high):
        yield line if GAP in line else f"{line}   {GAP} the limits of its counts: in the unit"
    yield f'object = "{found.index:04X}.{found.sub}"'
    yield f"slope = {found.factor:g}   {GAP} unit per count"
