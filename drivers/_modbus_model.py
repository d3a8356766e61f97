"""A kind of Modbus device: its registers, and what its description says of watchdog, enabling and faults."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from drivers._registers import Register, WordOrder
from hil.daq.channel import Terminal
from hil.description.modbus import (
    TIMES,
    Enable,
    Faults,
    ModbusDescription,
    ModbusTerminal,
    Place,
    SafeMode,
    Wire,
    Write,
    safe_of,
)
from hil.errors import SettingError


@dataclass(frozen=True, slots=True)
class Model:
    """A kind of device.

    Attributes:
        registers: by terminal.
        watchdog: how its watchdog is armed over Modbus: registers and what is written to them in this order, numbers
            or `{tenths}`, `{seconds}`, `{ms}` (its time in that unit) and `{safe:TERMINAL}` (the count of the safe
            value of the channel on that terminal; nothing is written where none is connected). Empty when it is set
            by other means, and the bench file then only says how it was set.
        expires_to: where the device puts its outputs when its watchdog expires, if it is always the same; it is
            armed only where that is every channel's safe value.
        enable, faults, safe_mode, wire: as in `hil.description.modbus`, with addresses as they stand on the wire.
    """

    registers: Mapping[str, Register]
    watchdog: Sequence[tuple[int, int | str] | Write] = ()
    expires_to: float | None = None
    word_order: WordOrder = "big"
    enable: Enable | None = None
    faults: Faults | None = None
    safe_mode: SafeMode | None = None
    wire: Wire = field(default_factory=lambda: Wire.model_validate({"addresses": "wire"}))

    def __post_init__(self) -> None:
        for step in self.arming:
            if isinstance(step.value, str):
                _check_placeholder(step.address, step.value, self.outputs)

    @property
    def arming(self) -> tuple[Write, ...]:
        """What is written to arm its watchdog."""
        return tuple(
            step if isinstance(step, Write) else Write.model_construct(table="holding", address=step[0], value=step[1])
            for step in self.watchdog
        )

    @property
    def outputs(self) -> dict[str, Register]:
        """Registers of outputs by terminal."""
        return {name: register for name, register in self.registers.items() if register.direction == "out"}

    @property
    def terminals(self) -> dict[str, Terminal]:
        """The register map as terminals."""
        return {
            name: Terminal(r.direction, r.kind, r.unit, r.low, r.high, step=r.step)
            for name, r in self.registers.items()
        }


def model_of(description: ModbusDescription) -> Model:
    """The model that a description says."""
    described = description.on_the_wire
    arm, expires_to = (described.watchdog.arm, described.watchdog.expires_to) if described.watchdog else ((), None)
    return Model(
        {name: _register(terminal) for name, terminal in described.terminals.items()}, arm, expires_to,
        described.modbus.byte_order, described.enable, described.faults, described.safe_mode, described.modbus,
    )  # fmt: skip


def _register(described: ModbusTerminal) -> Register:
    port = described.terminal
    back = described.read_back if isinstance(described.read_back, Place) else None
    return Register(
        port.direction, port.kind, port.unit, port.low, port.high, described.table or "holding", described.address,
        described.type or "u16", *described.scale,
        back.address if back else None, back.table if back else None, described.byte_order, described.field,
        described.write or 0, back is not None or port.direction == "in", described.close, described.invalid,
        described.status,
    )  # fmt: skip


def levels_of(model: Model) -> dict[str, float]:
    """Where the watchdog of a device of this model puts its outputs, if that is always the same."""
    return {} if model.expires_to is None else dict.fromkeys(model.outputs, model.expires_to)


def _check_placeholder(address: int, text: str, outputs: Mapping[str, Register]) -> None:
    if text not in TIMES and safe_of(text) not in outputs:
        raise SettingError(
            f"Model.watchdog: '{text}' for register {address:#06x}: a number, {', '.join(TIMES)} or "
            f"{{safe:TERMINAL}} with the name of an output"
        )
