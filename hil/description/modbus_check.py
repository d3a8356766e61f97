"""What makes no sense together in the description of a Modbus device."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, get_args

from hil.bench.lines import Place as Where
from hil.description.modbus import WORDS, Flag, ModbusDescription, ModbusTerminal, Order, Place, Type, Write, safe_of
from hil.description.modbus_place import BITS, Table
from hil.strict import Strict

Fault = tuple[Where, str]


def modbus_faults(description: ModbusDescription) -> Iterator[Fault]:
    """Every fault with its place in the file; the text says what is allowed."""
    for name, terminal in description.terminals.items():
        yield from ((("terminals", name, *key), text) for key, text in _terminal(description, terminal))
    for where, place in _places(description):
        try:
            table, _ = description.wire(place)
        except ValueError as error:
            yield (*where, "address"), str(error)
            continue
        if isinstance(place, Write):
            yield from _write(where, place, table, description.outputs)
        if isinstance(place, Flag) and place.bit and table in BITS:
            yield (*where, "bit"), f"a {table} is one bit; take this away"
        elif isinstance(place, Flag) and place.highest_bit > 15:
            yield where, "a register has the bits 0 … 15"
    yield from description.needless()


def _terminal(description: ModbusDescription, terminal: ModbusTerminal) -> Iterator[Fault]:
    try:
        table, _ = description.place_of(terminal)
        _, last = description.place_of(terminal, terminal.count - 1)
        form, is_bit = description.form_of(terminal), table in BITS
    except ValueError as error:
        yield ("address",), str(error)
        return
    if last + WORDS[form] - 1 > 0xFFFF:
        yield ("address",), f"{terminal.address}: its last register would be {last + WORDS[form] - 1}, beyond 65535"
    for key in ("longest_read", "longest_write"):
        if getattr(description.modbus, key) < WORDS[form]:
            yield (
                ("type",),
                f"'{form}' takes {WORDS[form]} registers, more than {key} = {getattr(description.modbus, key)}",
            )
    if is_bit and form != "bit":
        yield ("type",), f"'{form}': a {table} is a bit; take type away"
    if not is_bit and form == "bit":
        yield (
            ("type",),
            f"'bit': a register is {', '.join(t for t in get_args(Type) if t != 'bit')}; one bit is bit = …",
        )
    yield from _field(terminal, form)
    yield from _order(terminal, form)
    if terminal.direction == "out":
        yield from _output(description, terminal, table, form)


def _field(terminal: ModbusTerminal, form: Type) -> Iterator[Fault]:
    if terminal.field is None:
        return
    key, (lowest, width) = "bit" if terminal.bit is not None else "bits", terminal.field
    if form in ("bit", "f32", "f64"):
        yield (key,), f"a part of a register of whole numbers; this is '{form}'"
    elif width < 1 or lowest < 0 or lowest + width > 16 * WORDS[form]:
        yield (key,), f"lowest and highest bit of 0 … {16 * WORDS[form] - 1}, the lowest first"


def _order(terminal: ModbusTerminal, form: Type) -> Iterator[Fault]:
    order, words = terminal.byte_order, WORDS[form]
    if order is not None and (order in get_args(Order)) != (words > 1):
        yield ("byte_order",), f"'{order}': AB or BA for one register, ABCD, CDAB, BADC or DCBA for several"


def _output(description: ModbusDescription, terminal: ModbusTerminal, table: Table, form: Type) -> Iterator[Fault]:
    if terminal.sets and (of := terminal.sets.rpartition(".")[0]) not in description.outputs:
        yield ("sets",), f"no output '{of}'; there are: {', '.join(description.outputs)}"
    if table in ("input", "discrete"):
        yield ("address",), f"an output stands in a coil or a holding register; a {table} one can only be read"
        return
    if terminal.write is not None and (terminal.write in (5, 15)) != (table == "coil"):
        yield ("write",), f"{terminal.write}: functions 5 and 15 write coils, 6 and 16 holding registers"
    elif terminal.write == 6 and WORDS[form] > 1:
        yield ("write",), "6 writes one register; this type takes several: say 16"
    try:
        back = description.read_back_of(terminal)
    except ValueError as error:
        yield ("read_back",), str(error)
        return
    if back is not None and (back[0] in BITS) != (table in BITS):
        yield ("read_back",), f"a {table} is not read back in a {back[0]} register"
    if back is None and terminal.field is not None:
        yield ("read_back",), "part of a register is written with the rest of it, which must be read: take this away"


def _write(where: Where, write: Write, table: Table, outputs: list[str]) -> Iterator[Fault]:
    if table in ("input", "discrete"):
        yield (*where, "address"), f"a {table} one can only be read; coils and holding registers are written"
    if (terminal := safe_of(write.value)) and outputs and terminal not in outputs:
        yield (*where, "value"), f"no output '{terminal}'; there are: {', '.join(outputs)}"
    limit = 1 if table == "coil" else 0xFFFF
    if isinstance(write.value, int) and not 0 <= write.value <= limit:
        yield (*where, "value"), f"{write.value}: a {table} takes 0 … {limit}"


def _places(stated: Any, where: Where = ()) -> Iterator[tuple[Where, Place]]:
    """Every place beside the terminals in what is said, and where it stands in the file."""
    if isinstance(stated, Place):
        yield where, stated
    elif isinstance(stated, ModbusTerminal):
        yield from _places(stated.status, (*where, "status"))
    elif isinstance(stated, Strict):
        for key, value in stated:
            yield from _places(value, (*where, key))
    elif isinstance(stated, dict | tuple):
        for at, value in stated.items() if isinstance(stated, dict) else enumerate(stated):
            yield from _places(value, (*where, at))
