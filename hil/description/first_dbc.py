"""The first description of a device on CAN, from a DBC file."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hil.description.can import database
from hil.description.gaps import GAP, head, range_line, unique, unit_line
from hil.errors import FileError

_NONE = re.compile(
    r"(?<![a-z])(sna|n\.?/?a|not?[ _]?(avail|valid|used|defined)|unavail|invalid|undef|error|err|fault|init)",
    re.IGNORECASE,
)


def from_dbc(path: Path) -> Iterator[str]:
    """Its lines. Raises `FileError` for what is no DBC file, or one without a signal."""
    found = database(str(path))
    if not any(message.signals for message in found.messages):
        raise FileError(f"{path}: no message with a signal in it, so there is nothing to describe")
    yield from head(path, "can")
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
            yield f'[terminals."{unique(signal.name, names, message.name)}"]'
            yield f'direction = "in"   {GAP} "out" if the bench sends {message.name}'
            yield unit_line(signal.unit or "", True)
            yield from range_line(
                *("" if limit is None else f"{limit:g}" for limit in (signal.minimum, signal.maximum))
            )
            yield f'message = "{message.name}"'
            yield f'signal = "{signal.name}"'
            yield from _none_by_name(signal)
    yield ""
    yield f"{GAP} [watchdog] time_s, expires_to, where the bench sends commands: where outputs go when these end"


def _none_by_name(signal: Any) -> Iterator[str]:
    """Counts of a quantity whose names say that they are no measurement; of a state every count has a name."""
    names = {count: str(name) for count, name in (signal.choices or {}).items()}
    none = {count: name for count, name in names.items() if _NONE.search(name)}
    if none:
        pairs = ", ".join(f'"{count}" = {json.dumps(name)}' for count, name in none.items())
        is_quantity = signal.length >= 8 and len(names) <= 8
        yield f"{'' if is_quantity else '# '}invalid = {{ {pairs} }}   {GAP} by their names: are they no measurement?"
