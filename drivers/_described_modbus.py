"""A description of a Modbus device as the driver's model of it."""

from __future__ import annotations

from drivers._modbus_model import Enabling, Model, Step
from drivers._registers import Flag, Register
from hil.description import modbus as words
from hil.description.terminal import counts_of, each, nan_of


def model_of(description: words.ModbusDescription) -> Model:
    """The model that a description says."""
    safe, watchdog, wire = description.safe_mode, description.watchdog, description.modbus
    enable, faults = description.enable, description.faults
    return Model(
        {one: _register(description, terminal, i) for name, terminal in description.terminals.items()
         for one, i in each(name, terminal)},
        watchdog=_steps(description, watchdog.arm) if watchdog else (),
        expires_to=watchdog.expires_to if watchdog else None,
        safe_status=description.wire(safe.status)[1] if safe else None,
        clear_safe=description.wire(safe.clear)[1] if safe else None,
        word_order=wire.byte_order,
        enabling=Enabling(
            _steps(description, enable.write),
            _flag(description, enable.ready) if enable.ready else None,
            enable.patience_s, _steps(description, enable.disable),
        ) if enable else Enabling(),
        faults=tuple(_flag(description, flag) for flag in faults.flags) if faults else (),
        clear=_steps(description, faults.clear) if faults else (),
        clear_patience_s=faults.patience_s if faults else 1.0,
        gap=wire.gap, longest_read=wire.longest_read, longest_write=wire.longest_write,
        pause_s=wire.pause_s, echo=wire.echo, may_have_watchdog=watchdog is not None,
    )  # fmt: skip


def _register(description: words.ModbusDescription, terminal: words.ModbusTerminal, i: int) -> Register:
    table, address = description.place_of(terminal, i)
    port, (slope, offset) = description.kind_of(terminal), terminal.scale
    back = description.read_back_of(terminal, i) if terminal.direction == "out" else (table, address)
    form = description.form_of(terminal)
    return Register(
        port.direction, port.kind, port.unit, port.low, port.high, table, address, form, slope, offset,
        None if back is None else back[1], None if back is None else back[0], terminal.byte_order, terminal.field,
        terminal.write or 0, back is not None, terminal.close, counts_of(terminal.invalid), nan_of(terminal.invalid),
        tuple(_flag(description, flag.of_row(i)) for flag in terminal.status),
    )  # fmt: skip


def _flag(description: words.ModbusDescription, flag: words.Flag) -> Flag:
    table, address = description.wire(flag)
    mask = 1 << flag.bit if flag.bit is not None else flag.mask or 0xFFFF
    equals = flag.equals
    if flag.bit is not None and equals is not None:
        equals = (equals & 1) << flag.bit
    return Flag(table, address, mask, equals, flag.means)


def _steps(description: words.ModbusDescription, writes: tuple[words.Write, ...]) -> tuple[Step, ...]:
    return tuple(Step(address, write.value, table) for write in writes for table, address in [description.wire(write)])
