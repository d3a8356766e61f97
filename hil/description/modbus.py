"""A Modbus device in words: registers and coils, their types and scales, and what makes its outputs safe."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import Field, FiniteFloat, PositiveFloat, field_validator, model_validator

from hil.daq.channel import Kind, Terminal
from hil.description.modbus_place import BITS, Addresses, Table, on_the_wire
from hil.description.terminal import DescribedDevice, Flagged, PartTerminal, each
from hil.strict import Strict

Type = Literal["bit", "u16", "s16", "u32", "s32", "f32", "u64", "s64", "f64"]
Order = Literal["ABCD", "CDAB", "BADC", "DCBA"]
WORDS: Mapping[Type, int] = {form: 1 if form == "bit" else int(form[1:]) // 16 for form in get_args(Type)}
TIMES: Mapping[str, float] = {"{tenths}": 10.0, "{seconds}": 1.0, "{ms}": 1000.0}
"""What a watchdog's time is written as, and its counts in a second."""
_SAFE = re.compile(r"\{safe:(.+)\}")
Address = Annotated[int, Field(ge=0)]


def safe_of(value: int | str) -> str:
    """The terminal of `{safe:TERMINAL}`, else nothing."""
    found = _SAFE.fullmatch(value) if isinstance(value, str) else None
    return found[1] if found else ""


class Place(Strict):
    """A register or coil beside the terminals: `table` and `address` in the style of the file."""

    address: Address
    table: Table | None = None


class Write(Place):
    """What is written there: a number, `{tenths}`, `{seconds}`, `{ms}` (the watchdog's time), `{safe:TERMINAL}`.

    `{safe:TERMINAL}` takes as many registers as the terminal; nothing is written where the bench has nothing on it.
    """

    value: int | str

    @field_validator("value")
    @classmethod
    def _known(cls, value: int | str) -> int | str:
        if isinstance(value, int) or value in TIMES or safe_of(value):
            return value
        raise ValueError(f"'{value}': a number, {', '.join(TIMES)} or {{safe:TERMINAL}} with the name of an output")


class Flag(Place, Flagged):
    """A flag in a register, or a coil.

    Attributes:
        step: from the flag of one terminal of a row to that of the next, in registers.
    """

    step: int = Field(0, ge=0, le=1000)


class ModbusTerminal(PartTerminal):
    """A terminal in registers or coils: value = slope · count + offset, or `raw` counts at the ends of the range.

    Attributes:
        table, address: where it stands; with `addresses = "40001"` the address says the table.
        type: of the count; `bit` in coils and discrete inputs.
        byte_order: of more than one register, where it is not that of the device; `BA` swaps the bytes of one.
        raw: counts at `range`'s ends.
        write: by which function, 5, 6, 15 or 16; 5 for coils and 16 for registers if not said.
        read_back: where an output is read back, if that is another place; `false` where it cannot be.
        status: flags that say that it is none.
        sets: `OUTPUT.carrier_hz`, `.dither_hz` or `.dither_amplitude`: no terminal of its own, but what the `pwm` of
            the channel on that output is set by when the device is opened.
        step: from the first register of one to that of the next in a row; as many as one takes if not given.
    """

    table: Table | None = None
    address: Address
    type: Type | None = None
    byte_order: Order | Literal["AB", "BA"] | None = None
    raw: tuple[FiniteFloat, FiniteFloat] | None = None
    write: Literal[5, 6, 15, 16] | None = None
    read_back: Literal[False] | Address | Place | None = None
    status: tuple[Flag, ...] = ()
    sets: str | None = Field(None, pattern=r".\.(carrier_hz|dither_hz|dither_amplitude)$")
    step: int | None = Field(None, ge=1)

    @model_validator(mode="after")
    def _one_scale(self) -> Self:
        if self.raw is not None and self.model_fields_set & {"slope", "offset"}:
            raise ValueError("raw, or slope and offset, not both")
        if self.raw is not None and self.raw[0] == self.raw[1]:
            raise ValueError("raw: the counts at both ends of the range are the same")
        of_output = self.write, self.read_back, self.close, self.sets
        if self.direction == "in" and any(key is not None for key in of_output):
            raise ValueError("write, read_back, close and sets belong to an output")
        return self

    @property
    def terminal(self) -> Terminal:
        """As a bench connects to it: readings lie one count apart where it is counted."""
        is_counted = self.is_of != "digital" and (self.type or "")[:1] in ("u", "s")
        return replace(super().terminal, step=abs(self.scale[0]) if is_counted else 0.0)

    @property
    def is_read_back(self) -> bool:
        """Whether it may be read."""
        return self.read_back is not False

    @property
    def is_of(self) -> Kind:
        """Its kind; a bit of a table of bits is digital too."""
        return "digital" if self.kind is None and self.type == "bit" else super().is_of

    @property
    def scale(self) -> tuple[float, float]:
        """Slope and offset."""
        if self.raw is None:
            return self.slope, self.offset
        (low, high), (first, last) = self.range, self.raw
        slope = (high - low) / (last - first)
        return slope, low - slope * first


class Wire(Strict):
    """How the device is spoken to.

    Attributes:
        addresses: how addresses are counted in this file: as on the `wire`, from 0 in each table, or as `40001`.
        byte_order: of numbers in several registers; `ABCD` is the highest byte first.
        longest_read, longest_write: registers that one request may have.
        gap: so many registers that nothing is wanted of may be read across; some devices refuse any.
        pause_s: so long nothing is asked after an answer.
        echo: what is sent on a serial line comes back first.
    """

    addresses: Addresses
    byte_order: Order = "ABCD"
    longest_read: int = Field(125, ge=1, le=125)
    longest_write: int = Field(123, ge=1, le=123)
    gap: int = Field(0, ge=0, le=124)
    pause_s: float = Field(0.0, ge=0.0, le=1.0)
    echo: bool = False


class Watchdog(Strict):
    """What makes the outputs safe when nothing is asked any more.

    Attributes:
        arm: what is written, in this order; empty where it is set at the device itself.
        expires_to: where outputs go then, in their unit, if it is always the same; it is armed only where that is
            safe. Without, they go where `{safe:TERMINAL}` was written.
    """

    arm: tuple[Write, ...] = ()
    expires_to: FiniteFloat | None = None


class SafeMode(Strict):
    """Outputs that the device itself made safe: a coil for each output that says so, and one that ends it.

    Both are those of the first output; the others follow in the order of their registers.
    """

    status: Place
    clear: Place


class Enable(Strict):
    """What outputs need before they obey: written with the outputs at their safe values.

    Attributes:
        write: in this order.
        ready: what is so when they obey; it is waited for.
        patience_s: so long.
        disable: written when the device is let go of.
    """

    write: tuple[Write, ...]
    ready: Flag | None = None
    patience_s: PositiveFloat = 2.0
    disable: tuple[Write, ...] = ()


class Faults(Strict):
    """Faults that the device reports, and how they are cleared when it is opened.

    Attributes:
        flags: looked at when it is opened, and with every reading back of outputs.
        clear: written, in this order, when one is so at opening.
        patience_s: so long they may take to go.
    """

    flags: tuple[Flag, ...]
    clear: tuple[Write, ...] = ()
    patience_s: PositiveFloat = 1.0


class ModbusDescription(DescribedDevice[ModbusTerminal]):
    """A device on Modbus TCP or RTU."""

    protocol: Literal["modbus"]
    modbus: Wire
    watchdog: Watchdog | None = None
    safe_mode: SafeMode | None = None
    enable: Enable | None = None
    faults: Faults | None = None

    @cached_property
    def by_name(self) -> dict[str, ModbusTerminal]:
        """Every terminal by its own name; tables and addresses, types and read-backs are those on the wire."""
        return {one: self._laid(terminal, i) for name, terminal in self.terminals.items()
                for one, i in each(name, terminal)}  # fmt: skip

    @property
    def ports(self) -> dict[str, Terminal]:
        """What a bench can connect to."""
        return {name: port for name, port in super().ports.items() if self.by_name[name].sets is None}

    def _laid(self, terminal: ModbusTerminal, i: int) -> ModbusTerminal:
        table, address = self.place_of(terminal, i)
        back = self.read_back_of(terminal, i) if terminal.direction == "out" else None
        flags = (flag.model_copy(update={"address": flag.address + i * flag.step}) for flag in terminal.status)
        there = {
            "table": table, "address": address, "type": self.form_of(terminal), "status": tuple(map(self.there, flags)),
            "read_back": back is not None and Place(table=back[0], address=back[1]),
        }  # fmt: skip
        return terminal.of_row(i).model_copy(update=there)

    @cached_property
    def on_the_wire(self) -> Self:
        """The same with each terminal by itself, and every address as it stands on the wire."""
        wire = self.modbus.model_copy(update={"addresses": "wire"})
        sections = {key: self.there(getattr(self, key)) for key in ("watchdog", "safe_mode", "enable", "faults")}
        return self.model_copy(update={"terminals": self.by_name, "modbus": wire, **sections})

    def there(self, part: Any) -> Any:
        """A place beside the terminals, or what has some in it, with wire addresses."""
        if isinstance(part, Place):
            table, address = self.wire(part)
            return part.model_copy(update={"table": table, "address": address})
        if isinstance(part, tuple):
            return tuple(map(self.there, part))
        if isinstance(part, Strict):
            return part.model_copy(update={key: self.there(value) for key, value in part})
        return part

    def place_of(self, terminal: ModbusTerminal, i: int = 0) -> tuple[Table, int]:
        """Table and wire address of the i-th of a row."""
        table, address = on_the_wire(terminal.address, terminal.table, self.modbus.addresses)
        return table, address + i * (terminal.step or WORDS[self.form_of(terminal)])

    def form_of(self, terminal: ModbusTerminal) -> Type:
        """The type of a terminal: a bit where the table has nothing else."""
        table, _ = on_the_wire(terminal.address, terminal.table, self.modbus.addresses)
        return terminal.type or ("bit" if table in BITS else "u16")

    def wire(self, place: Place) -> tuple[Table, int]:
        """Table and wire address of a place beside the terminals; a holding register if not said."""
        table = place.table or ("holding" if self.modbus.addresses == "wire" else None)
        return on_the_wire(place.address, table, self.modbus.addresses)

    def read_back_of(self, terminal: ModbusTerminal, i: int = 0) -> tuple[Table, int] | None:
        """Where an output is read back; None where it cannot be."""
        stated, (table, address) = terminal.read_back, self.place_of(terminal, i)
        if stated is None:
            return table, address
        if stated is False:
            return None
        by_number = self.modbus.addresses == "40001"
        place = stated if isinstance(stated, Place) else Place(address=stated, table=None if by_number else table)
        table_there, there = self.wire(place)
        return table_there, there + address - self.place_of(terminal)[1]
