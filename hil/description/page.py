"""What a description says, as a page of documentation."""

from __future__ import annotations

from collections.abc import Iterator

from hil.description.can import CanDescription
from hil.description.canopen import CanopenDescription, CanopenTerminal
from hil.description.modbus import Flag, ModbusDescription, Place, Write
from hil.description.modbus_place import as_in_manuals
from hil.description.read import Description
from hil.description.terminal import DescribedTerminal
from hil.description.text import TextDescription
from hil.units import behind_a_number


def page(name: str, told: Description, level: str = "#") -> Iterator[str]:
    """Lines of Markdown: what the device is, its terminals, what makes it safe.

    Args:
        name: of the description.
        told: what it says.
        level: of the heading.
    """
    yield f"{level} {name}"
    yield ""
    yield f'{told.summary}. `driver = "{told.protocol}"`, `model = "{name}"`.'
    if told.source:
        yield f"After: {told.source}."
    yield ""
    yield "| terminal | | unit | range | where |"
    yield "|---|---|---|---|---|"
    for key, terminal in told.terminals.items():
        low, high = terminal.range
        way = "driven" if terminal.direction == "out" else "read"
        yield f"| {_names(key, terminal)} | {way} | {terminal.unit} | {low:g} … {high:g} | {_where(told, key)} |"
    safety = list(_safety(told))
    yield from ["", *safety] if safety else []


def _names(key: str, terminal: DescribedTerminal) -> str:
    if terminal.count == 1:
        return f"`{key}`"
    first, last = (key.replace("{n}", str(n)) for n in (terminal.first, terminal.first + terminal.count - 1))
    return f"`{first}` … `{last}`"


def _where(told: Description, key: str) -> str:
    if isinstance(told, ModbusDescription):
        return _in_registers(told, key)
    if isinstance(told, TextDescription):
        text = told.terminals[key]
        return ", ".join(f"`{line}`" for line in (text.tell, text.ask) if line)
    if isinstance(told, CanDescription):
        return f"`{told.terminals[key].message}.{told.terminals[key].signal}`"
    if isinstance(told, CanopenDescription):
        return _in_object(told.terminals[key])
    return "a channel of the module"


def _in_object(terminal: CanopenTerminal) -> str:
    if terminal.field is None:
        return f"object {terminal.object}"
    first, width = terminal.field
    last = first + terminal.count * width - 1
    return f"object {terminal.object}, " + (f"bit {first}" if last == first else f"bits {first} … {last}")


def _in_registers(told: ModbusDescription, key: str) -> str:
    terminal = told.terminals[key]
    table, address = told.place_of(terminal)
    form = told.form_of(terminal)
    part = "" if terminal.field is None else f", bits {terminal.field[0]} … {terminal.field[0] + terminal.field[1] - 1}"
    said = f"{table} {address:#06x} ({as_in_manuals(table, address)}), {form}{part}"
    if terminal.raw is not None:
        said += f", counts {terminal.raw[0]:g} … {terminal.raw[1]:g}"
    elif terminal.scale != (1.0, 0.0):
        said += f", {terminal.scale[0]:g} a count" + (f" + {terminal.scale[1]:g}" if terminal.scale[1] else "")
    back = told.read_back_of(terminal) if terminal.direction == "out" else (table, address)
    if back is None:
        return f"{said}; cannot be read back"
    return said if back == (table, address) else f"{said}; read back at {back[0]} {back[1]:#06x}"


def _safety(told: Description) -> Iterator[str]:
    outputs = [t for t in told.terminals.values() if t.direction == "out"]
    watchdog = getattr(told, "watchdog", None)
    if not outputs:
        return
    if watchdog is None and told.protocol != "ascii_module":
        yield "**It has no watchdog**: outputs stay where they are when the computer stops; the bench needs an enable"
        yield "line."
    elif watchdog is not None and watchdog.expires_to is not None:
        unit = behind_a_number(outputs[0].unit)
        yield f"When its watchdog expires outputs go to {watchdog.expires_to:g}{unit}."
    if isinstance(told, ModbusDescription):
        yield from _sequences(told)


def _sequences(told: ModbusDescription) -> Iterator[str]:
    for what, writes in (
        ("Watchdog", told.watchdog.arm if told.watchdog else ()),
        ("Enabled by", told.enable.write if told.enable else ()),
        ("Faults are cleared by", told.faults.clear if told.faults else ()),
    ):
        if writes:
            yield f"{what}: {', '.join(_write(told, write) for write in writes)}."
    for flag in told.faults.flags if told.faults else ():
        yield f"Reports at {_place(told, flag)}: {flag.means or 'a fault'}{_bit(flag)}."


def _write(told: ModbusDescription, write: Write) -> str:
    value = write.value if isinstance(write.value, str) else f"{write.value:#06x}"
    return f"{value} → {_place(told, write)}"


def _place(told: ModbusDescription, place: Place) -> str:
    table, address = told.wire(place)
    return f"{table} {address:#06x}"


def _bit(flag: Flag) -> str:
    return f" (bit {flag.bit})" if flag.bit is not None else ""
