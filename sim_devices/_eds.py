"""The objects of an EDS or DCF as a node has them; read as the text that it is, without the drivers' library."""

from __future__ import annotations

import re
from configparser import ConfigParser
from pathlib import Path

from hil.untrusted import read_small

_FORMS = {"0x0001": "B", "0x0002": "b", "0x0003": "h", "0x0004": "i", "0x0005": "B", "0x0006": "H", "0x0007": "I",
          "0x0008": "f"}  # fmt: skip
_SECTION = re.compile(r"([0-9A-Fa-f]{4})(?:[sS]ub([0-9A-Fa-f]+))?")


def objects_of(path: str, node: int) -> dict[tuple[int, int], tuple[str, float, bool]]:
    """By index and sub-index: struct format, value after power-on, whether it may be written."""
    parser = ConfigParser(interpolation=None, strict=False)
    parser.read_string(read_small(Path(path)).decode("latin-1"))
    found: dict[tuple[int, int], tuple[str, float, bool]] = {}
    for section in parser.sections():
        place = _SECTION.fullmatch(section)
        entry = parser[section]
        form = _FORMS.get(f"0x{int(entry.get('DataType', '0') or '0', 0):04x}")
        if place is None or form is None:
            continue
        writable = entry.get("AccessType", "ro").lower() in ("rw", "wo", "rww", "rwr")
        value = _number(entry.get("ParameterValue") or entry.get("DefaultValue") or "0", node)
        found[int(place[1], 16), int(place[2] or "0", 16)] = (form, value, writable)
    return found


def _number(text: str, node: int) -> float:
    parts = [part.strip() for part in text.upper().split("+")]
    try:
        return sum(node if part == "$NODEID" else int(part, 0) for part in parts)
    except ValueError:
        try:
            return float(text)
        except ValueError:
            return 0
