"""Descriptions as they stand in a file or in a bench file; read, or everything that is wrong with them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from hil.bench.draft import sound_part
from hil.bench.fault import BenchError, Fault
from hil.bench.files import at_home
from hil.bench.lines import Place, line_at, lines_of
from hil.description.ascii_module import ModuleDescription
from hil.description.can import CanDescription, can_faults
from hil.description.canopen import CanopenDescription, canopen_faults
from hil.description.modbus import ModbusDescription
from hil.description.modbus_check import modbus_faults
from hil.description.terminal import name_faults
from hil.description.text import TextDescription, text_faults
from hil.errors import SettingError, reading
from hil.untrusted import parse_toml, read_text

Description = CanDescription | CanopenDescription | ModbusDescription | ModuleDescription | TextDescription
"""A device in words, by protocol."""
_PROTOCOLS: Mapping[str, tuple[type[BaseModel], Callable[[Any], Iterable[tuple[Place, str]]]]] = {
    "modbus": (ModbusDescription, modbus_faults),
    "can": (CanDescription, can_faults),
    "canopen": (CanopenDescription, canopen_faults),
    "ascii_module": (ModuleDescription, lambda _description: ()),
    "text": (TextDescription, text_faults),
    "scpi": (TextDescription, text_faults),
}


def read_description(path: Path) -> Description:
    """The description in a file.

    Raises:
        FileError: it cannot be read, or is not TOML (the message names the line).
        BenchError: it has faults, each with its line and what is allowed.
    """
    with reading(path):
        return _read(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=64)
def _read(path: Path, _changed: int) -> Description:
    with reading(path, "not a description"):
        text = read_text(path)
    content = parse_toml(text, f"{path}: not a description")
    description, faults = checked(at_home(content, path.parent))
    if description is None or faults:
        lines = lines_of(text)
        in_order = sorted(faults, key=lambda fault: line_at(lines, fault.place) or 0)
        raise BenchError(list(dict.fromkeys(fault.described(path, lines) for fault in in_order)))
    return description


def checked(content: Mapping[str, Any]) -> tuple[Description | None, list[Fault]]:
    """A description from what a file says, or its faults."""
    protocol = str(content.get("protocol", ""))
    if protocol not in _PROTOCOLS:
        found = "is missing" if not protocol else f"'{protocol}' is not known"
        return None, [Fault(("protocol",), f"{found}; there are: {', '.join(_PROTOCOLS)}")]
    model, rules = _PROTOCOLS[protocol]
    description, faults = sound_part(model, dict(content), ())
    if description is not None and not faults:
        faults = [Fault(*found) for found in (*name_faults(description.terminals), *rules(description))]
    return (None if faults else description), faults


def of_protocol(description: Description, protocol: str, where: str) -> Description:
    """The description, if it is of this protocol.

    Raises:
        SettingError: it is of another.
    """
    if description.protocol != protocol:
        raise SettingError(f'{where} is a description for driver = "{description.protocol}", not "{protocol}"')
    return description
