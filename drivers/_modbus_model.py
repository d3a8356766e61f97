"""A Modbus device by the table of its manual, in a driver of its own: the same as a description says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from drivers._registers import WordOrder, encodings
from hil.daq.channel import Direction, Kind
from hil.description.modbus import ModbusDescription, Type, Write
from hil.description.modbus_place import BITS, Table
from hil.description.named import Described, description_of


def Register(
    direction: Direction, kind: Kind, unit: str, low: float, high: float, table: Table, address: int,
    format: Type = "u16", slope: float = 1.0, offset: float = 0.0, *, bits: tuple[int, int] | None = None, **more: Any,
) -> dict[str, Any]:  # fmt: skip
    """Where a terminal stands in the registers of a device: value = slope · count + offset.

    Args:
        direction: `in` is read, `out` is driven.
        kind: as in `hil.daq.channel.Terminal`.
        unit: of its values, and of `low` and `high`.
        low: the lowest value.
        high: the highest one.
        table: `input` (read by function 4), `holding` (3), `coil` (1) or `discrete` (2).
        address: counted from 0, as it stands on the wire.
        format: `u16`, `s16`; in two registers `u32`, `s32`, `f32`, in four `u64`, `s64`, `f64`, whose value is the
            number itself. In coils and discrete inputs it is a bit, whatever is said.
        slope: value of one count.
        offset: value of the count 0.
        bits: lowest bit and number of bits, where the rest of the register is something else.
        more: what else a description says of a terminal (`hil.description.modbus.ModbusTerminal`).
    """
    return {
        "direction": direction, "kind": kind, "unit": unit, "range": (low, high), "table": table, "address": address,
        "type": None if table in BITS else format, "slope": slope, "offset": offset,
        "bits": bits and (bits[0], bits[0] + bits[1] - 1), **more,
    }  # fmt: skip


class Model:
    """A kind of device.

    Args:
        registers: by terminal.
        watchdog: how its watchdog is armed over Modbus: registers and what is written to them in this order, numbers
            or `{tenths}`, `{seconds}`, `{ms}` (its time in that unit) and `{safe:TERMINAL}` (the count of the safe
            value of the channel on that terminal; nothing is written where none is connected). Empty when it is set
            by other means, and the bench file then only says how it was set.
        expires_to: where the device puts its outputs when its watchdog expires, if it is always the same; it is
            armed only where that is every channel's safe value.
        word_order: of numbers in several registers.
        sections: `enable`, `faults` and `safe_mode`, as in `hil.description.modbus`, with addresses on the wire.

    Attributes:
        described: the same as a description.
        registers: its numbers in them, by terminal; terminals: what a bench connects to.

    Raises:
        SettingError: what makes no sense in it, all of it.
    """

    def __init__(
        self, registers: Mapping[str, Mapping[str, Any]], watchdog: Sequence[tuple[int, int | str] | Write] = (),
        expires_to: float | None = None, word_order: WordOrder = "big", **sections: Any,
    ) -> None:  # fmt: skip
        order = {"big": "ABCD", "little": "CDAB"}.get(word_order, word_order)
        arm = [step if isinstance(step, Write) else {"address": step[0], "value": step[1]} for step in watchdog]
        has_one = arm or expires_to is not None
        stated = {
            "summary": "by its driver", "terminals": registers, "modbus": {"addresses": "wire", "byte_order": order},
            "watchdog": {"arm": arm, "expires_to": expires_to} if has_one else None, **sections,
        }  # fmt: skip
        self.described: ModbusDescription = description_of(Described(description=stated), "modbus")
        self.registers, self.terminals = encodings(self.described), self.described.ports


def described_by(model: ModbusDescription | Model) -> ModbusDescription:
    """What a device is, with addresses as they stand on the wire."""
    return (model.described if isinstance(model, Model) else model).on_the_wire


def levels_of(model: ModbusDescription | Model) -> dict[str, float]:
    """Where the watchdog of a device of this model puts its outputs, if that is always the same."""
    described = described_by(model)
    level = described.watchdog.expires_to if described.watchdog else None
    return {} if level is None else dict.fromkeys(described.outputs, level)
