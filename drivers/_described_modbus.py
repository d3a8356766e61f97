"""A description of a Modbus device as the driver's model of it."""

from __future__ import annotations

from drivers._modbus_model import Enabling, Model, Step
from drivers._registers import Flag, Register
from hil.description import modbus as words
from hil.description.terminal import counts_of, each, nan_of


def model_of(told: words.ModbusDescription) -> Model:
    """The model that a description says."""
    safe, watchdog, wire = told.safe_mode, told.watchdog, told.modbus
    enable, faults = told.enable, told.faults
    return Model(
        {one: _register(told, terminal, i) for name, terminal in told.terminals.items()
         for one, i in each(name, terminal)},
        watchdog=_steps(told, watchdog.arm) if watchdog else (),
        expires_to=watchdog.expires_to if watchdog else None,
        safe_status=told.wire(safe.status)[1] if safe else None,
        clear_safe=told.wire(safe.clear)[1] if safe else None,
        word_order=wire.byte_order,
        enabling=Enabling(
            _steps(told, enable.write), _flag(told, enable.ready) if enable.ready else None, enable.patience_s,
            _steps(told, enable.disable),
        ) if enable else Enabling(),
        faults=tuple(_flag(told, flag) for flag in faults.flags) if faults else (),
        clear=_steps(told, faults.clear) if faults else (),
        clear_patience_s=faults.patience_s if faults else 1.0,
        gap=wire.gap, longest_read=wire.longest_read, longest_write=wire.longest_write,
        pause_s=wire.pause_s, echo=wire.echo, may_have_watchdog=watchdog is not None,
    )  # fmt: skip


def _register(told: words.ModbusDescription, terminal: words.ModbusTerminal, i: int) -> Register:
    table, address = told.place_of(terminal, i)
    port, (slope, offset) = told.kind_of(terminal), terminal.scale
    back = told.read_back_of(terminal, i) if terminal.direction == "out" else (table, address)
    form = told.form_of(terminal)
    return Register(
        port.direction, port.kind, port.unit, port.low, port.high, table, address, form, slope, offset,
        None if back is None else back[1], None if back is None else back[0], terminal.byte_order, terminal.field,
        terminal.write or 0, back is not None, terminal.close, counts_of(terminal.invalid), nan_of(terminal.invalid),
        tuple(_flag(told, flag.of_row(i)) for flag in terminal.status),
    )  # fmt: skip


def _flag(told: words.ModbusDescription, flag: words.Flag) -> Flag:
    table, address = told.wire(flag)
    mask = 1 << flag.bit if flag.bit is not None else flag.mask or 0xFFFF
    equals = flag.equals
    if flag.bit is not None and equals is not None:
        equals = (equals & 1) << flag.bit
    return Flag(table, address, mask, equals, flag.means)


def _steps(told: words.ModbusDescription, writes: tuple[words.Write, ...]) -> tuple[Step, ...]:
    return tuple(Step(address, write.value, table) for write in writes for table, address in [told.wire(write)])
