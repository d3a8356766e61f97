"""What a description says, as a page of documentation."""

from __future__ import annotations

from collections.abc import Iterator

from hil.description.can import CanDescription
from hil.description.canopen import CanopenDescription, CanopenTerminal
from hil.description.modbus import ModbusDescription, Place, Write
from hil.description.modbus_place import as_in_manuals
from hil.description.read import Description
from hil.description.terminal import DescribedTerminal
from hil.description.text import TextDescription
from hil.units import behind_a_number


def page(name: str, description: Description) -> Iterator[str]:
    """Lines of Markdown: what the device is, its terminals, what makes it safe.

    Args:
        name: of the description.
        description: what it says.
    """
    yield f"# {name}"
    yield ""
    yield f'{description.summary}. `driver = "{description.protocol}"`, `model = "{name}"`.'
    if description.source:
        yield f"After: {description.source}."
    yield ""
    yield "| terminal | | unit | range | where |"
    yield "|---|---|---|---|---|"
    for key, terminal in description.terminals.items():
        low, high = terminal.range
        way = "driven" if terminal.direction == "out" else "read"
        where = _where(description, key)
        yield f"| {names_of(key, terminal)} | {way} | {terminal.unit} | {low:g} … {high:g} | {where} |"
    safety = list(_safety(description))
    yield from ["", *safety] if safety else []


def names_of(key: str, terminal: DescribedTerminal) -> str:
    """The name of a terminal, or the first and the last of several."""
    if terminal.count == 1:
        return f"`{key}`"
    first, last = (key.replace("{n}", str(n)) for n in (terminal.first, terminal.first + terminal.count - 1))
    return f"`{first}` … `{last}`"


def _where(description: Description, key: str) -> str:
    if isinstance(description, ModbusDescription):
        return _in_registers(description, key)
    if isinstance(description, TextDescription):
        text = description.terminals[key]
        return ", ".join(f"`{line}`" for line in (text.tell, text.ask) if line)
    if isinstance(description, CanDescription):
        return f"`{description.terminals[key].message}.{description.terminals[key].signal}`"
    if isinstance(description, CanopenDescription):
        return _in_object(description.terminals[key])
    return "a channel of the module"


def _in_object(terminal: CanopenTerminal) -> str:
    if terminal.field is None:
        return f"object {terminal.object}"
    first, width = terminal.field
    last = first + terminal.count * width - 1
    return f"object {terminal.object}, " + (f"bit {first}" if last == first else f"bits {first} … {last}")


def _in_registers(description: ModbusDescription, key: str) -> str:
    terminal = description.terminals[key]
    table, address = description.place_of(terminal)
    form = description.form_of(terminal)
    part = "" if terminal.field is None else f", bits {terminal.field[0]} … {terminal.field[0] + terminal.field[1] - 1}"
    text = f"{table} {address:#06x} ({as_in_manuals(table, address)}), {form}{part}"
    if terminal.raw is not None:
        text += f", counts {terminal.raw[0]:g} … {terminal.raw[1]:g}"
    elif terminal.scale != (1.0, 0.0):
        text += f", {terminal.scale[0]:g} a count" + (f" + {terminal.scale[1]:g}" if terminal.scale[1] else "")
    back = description.read_back_of(terminal) if terminal.direction == "out" else (table, address)
    if back is None:
        return f"{text}; cannot be read back"
    return text if back == (table, address) else f"{text}; read back at {back[0]} {back[1]:#06x}"


def _safety(description: Description) -> Iterator[str]:
    outputs = [t for t in description.terminals.values() if t.direction == "out"]
    watchdog = getattr(description, "watchdog", None)
    if not outputs:
        return
    if watchdog is None and description.protocol != "ascii_module":
        yield "**It has no watchdog**: outputs stay where they are when the computer stops; the bench needs an enable"
        yield "line."
    elif watchdog is not None and watchdog.expires_to is not None:
        unit = behind_a_number(outputs[0].unit)
        yield f"When its watchdog expires outputs go to {watchdog.expires_to:g}{unit}."
    if isinstance(description, ModbusDescription):
        yield from _sequences(description.on_the_wire)


def _sequences(described: ModbusDescription) -> Iterator[str]:
    for what, writes in (
        ("Watchdog", described.watchdog.arm if described.watchdog else ()),
        ("Enabled by", described.enable.write if described.enable else ()),
        ("Faults are cleared by", described.faults.clear if described.faults else ()),
    ):
        if writes:
            yield f"{what}: {', '.join(map(_write, writes))}."
    for flag in described.faults.flags if described.faults else ():
        bit = f" (bit {flag.bit})" if flag.bit is not None else ""
        yield f"Reports at {_place(flag)}: {flag.means or 'a fault'}{bit}."


def _write(write: Write) -> str:
    value = write.value if isinstance(write.value, str) else f"{write.value:#06x}"
    return f"{value} → {_place(write)}"


def _place(place: Place) -> str:
    return f"{place.table} {place.address:#06x}"
