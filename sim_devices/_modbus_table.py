"""A Modbus device that is nothing but a table of registers, for twins of simple modules."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from hil.description.modbus import TIMES, ModbusDescription
from sim_devices._field import Side
from sim_devices._modbus_described import DescribedBank
from sim_devices._modbus_frames import RtuFrames, TcpFrames
from sim_devices._quirks import Quirks
from sim_devices._stream import StreamServer, TcpServer, serve_stream


class Place(NamedTuple):
    """A terminal in a register: count = value · per_unit + zero; two's complement if it is `signed`."""

    terminal: str
    per_unit: float
    zero: float = 0.0
    signed: bool = False

    def described(self, table: str, address: int) -> dict[str, Any]:
        """It as a description has it."""
        counts = (-0x8000, 0x7FFF) if self.signed else (0, 0xFFFF)
        low, high = sorted((count - self.zero) / self.per_unit for count in counts)
        return {
            "direction": "out" if table == "holding" else "in", "range": (low, high), "table": table,
            "address": address, "type": "s16" if self.signed else "u16", "slope": 1.0 / self.per_unit,
            "offset": -self.zero / self.per_unit,
        }  # fmt: skip


class Timer(NamedTuple):
    """A watchdog that is armed over the wire: the holding register of its time, and counts in a second (1, 10, 1000).

    `safe` are registers with the counts to which outputs go, by address of the output.
    """

    register: int
    per_second: float
    safe: Mapping[int, int] = {}


def Table(
    side: Side, outputs: Mapping[int, Place], inputs: Mapping[int, Place], watchdog_s: float | None = None,
    timer: Timer | None = None,
) -> DescribedBank:  # fmt: skip
    """A Modbus device that is nothing but the registers that its manual lists.

    Args:
        side: its terminals.
        outputs: by address among the holding registers (functions 3, 6, 16).
        inputs: by address among the input registers (function 4).
        watchdog_s: outputs go to 0 when nothing is asked for so long, as somebody set it at the device itself; None:
            nobody did. A twin of a device that its driver arms has a `timer` instead: one that is armed whatever the
            driver does says nothing about the driver.
        timer: its watchdog, where the driver arms it.
    """
    places = [("holding", outputs), ("input", inputs)]
    watchdog: dict[str, Any] | None = None if watchdog_s is None else {}
    if timer is not None:
        unit = {per_second: name for name, per_second in TIMES.items()}[timer.per_second]
        safe = {register: f"{{safe:{outputs[output].terminal}}}" for output, register in timer.safe.items()}
        watchdog = {"arm": [{"address": at, "value": value} for at, value in {**safe, timer.register: unit}.items()]}
    described = ModbusDescription.model_validate({
        "protocol": "modbus", "summary": "a table of registers", "modbus": {"addresses": "wire"}, "watchdog": watchdog,
        "terminals": {place.terminal: place.described(table, address)
                      for table, found in places for address, place in found.items()},
    })  # fmt: skip
    return DescribedBank(side, described, {"watchdog_s": watchdog_s})


def serve_registers(registers: Any, settings: Mapping[str, Any], side: Side, quirks: Quirks) -> StreamServer:
    """Serve registers where a driver's settings (`transport`, `address`, `unit_id`) will look for them."""
    unit_id, address = int(settings.get("unit_id", 1)), str(settings["address"])
    if settings.get("transport", "tcp") == "tcp":
        host, _, port = address.rpartition(":")
        return TcpServer(TcpFrames(registers, unit_id), side, quirks, host, int(port))
    return serve_stream(RtuFrames(registers, unit_id), side, quirks, address)
